// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <filesystem>
#include <memory>
#include <span>
#include <string>

#include "core/base/expected.hpp"

namespace locus {

/// The bytes of a file or pipe from front to back, unpacked on the way if need be. One owner.
class ByteStream {
 public:
  virtual ~ByteStream() = default;

  /// Fills `out` from its front with what is there by now, waiting for one byte at least, and says how far; 0 at the
  /// end.
  virtual std::size_t read(std::span<std::byte> out) = 0;
  /// Why the bytes ended before the end of the file, for the user; empty while all is well.
  [[nodiscard]] virtual std::string problem() const = 0;
  /// Share of the file that has been read, 0..1; 0 where its length is not known (a pipe).
  [[nodiscard]] virtual double progress() const = 0;
};

/// The bytes as they are; "-" is standard input. Fails with one line for the user when there is no such file, or it is
/// a folder.
Expected<std::unique_ptr<ByteStream>, std::string> open_stream(const std::filesystem::path& file);

} // namespace locus
