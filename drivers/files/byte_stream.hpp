// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <filesystem>
#include <memory>
#include <span>
#include <string>

#include "core/base/expected.hpp"

namespace locus {

/// Sequential bytes of a file or pipe, decompressed if necessary. Single owner, not thread-safe.
class ByteStream {
 public:
  virtual ~ByteStream() = default;

  /// Reads available bytes into the front of `out`; blocks until there is at least one. Returns their number; 0 at the
  /// end.
  virtual std::size_t read(std::span<std::byte> out) = 0;
  /// Explains to the user why the bytes ended before the end of the file; empty if there was no problem.
  [[nodiscard]] virtual std::string problem() const = 0;
  /// Share of the file that has been read, 0..1; 0 if its length is unknown (a pipe).
  [[nodiscard]] virtual double progress() const = 0;
};

/// Opens a file without decompression; "-" is standard input. Fails with one line for the user if there is no such file
/// or it is a folder.
Expected<std::unique_ptr<ByteStream>, std::string> open_stream(const std::filesystem::path& file);

} // namespace locus
