// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cerrno>
#include <cstddef>
#include <filesystem>
#include <fstream>
#include <span>
#include <string_view>
#include <system_error>
#include <utility>

#include <fmt/ostream.h>

#include "locus_replay/failure.hpp"

namespace locus::tools {

/// Creates an output folder and its parents, if missing. `option`: the one that named it. Throws Failure.
inline void make_folder(const std::filesystem::path& folder, std::string_view option = "-o") {
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error)
    throw Failure(ExitStatus::failed, fmt::format("{}: the folder cannot be created ({}); choose another with {}",
                                                  folder.string(), error.message(), option));
}

/// Output file, complete when close() returns. Throws Failure.
class OutputFile {
 public:
  explicit OutputFile(const std::filesystem::path& path) : path_(path), stream_(path, std::ios::binary) { check(); }

  template <class... Values> void print(fmt::format_string<Values...> format, Values&&... values) {
    fmt::print(stream_, format, std::forward<Values>(values)...);
  }
  /// Throws if an earlier write failed.
  void write(std::span<const std::byte> bytes) {
    stream_.write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
    check();
  }
  /// Returns to the start, to overwrite it.
  void rewind() { stream_.seekp(0); }
  void close() {
    stream_.close();
    check();
  }
  [[nodiscard]] const std::filesystem::path& path() const { return path_; }

 private:
  void check() const {
    if (!stream_)
      throw Failure(ExitStatus::failed, fmt::format("{}: cannot be written ({}); check permissions and free space",
                                                    path_.string(), std::generic_category().message(errno)));
  }

  std::filesystem::path path_;
  std::ofstream stream_;
};

} // namespace locus::tools
