// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cerrno>
#include <cstddef>
#include <filesystem>
#include <fstream>
#include <span>
#include <system_error>
#include <utility>

#include <fmt/ostream.h>

#include "locus_replay/failure.hpp"

namespace locus::tools {

/// A folder for output, and those above it; whether or not it is there already. Throws Failure.
inline void make_folder(const std::filesystem::path& folder) {
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error)
    throw Failure(ExitStatus::failed, fmt::format("{}: the folder cannot be made ({}); choose another with -o",
                                                  folder.string(), error.message()));
}

/// A file that was written in full when close() returns. Throws Failure.
class OutputFile {
 public:
  explicit OutputFile(const std::filesystem::path& path) : path_(path), stream_(path, std::ios::binary) { check(); }

  template <class... Values> void print(fmt::format_string<Values...> format, Values&&... values) {
    fmt::print(stream_, format, std::forward<Values>(values)...);
  }
  void write(std::span<const std::byte> bytes) {
    stream_.write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
  }
  /// What is written next replaces what was written first.
  void rewind() { stream_.seekp(0); }
  void close() {
    stream_.close();
    check();
  }

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
