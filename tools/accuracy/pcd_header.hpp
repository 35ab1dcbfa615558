// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <istream>
#include <optional>
#include <string>
#include <vector>

#include "core/base/expected.hpp"

namespace locus {

/// Reads a line without its end; nothing after the last, or where it is longer than any in a cloud, as in binary data.
std::optional<std::string> read_short_line(std::istream& stream);

/// What blanks part in it.
std::vector<std::string> words_of(const std::string& line);

/// What the header of a PCD file says of the points behind it.
struct PcdHeader {
  struct Field {
    std::string name;
    char type = 'F';       ///< F, U or I
    std::size_t bytes = 0; ///< of a number: 1, 2, 4 or 8
    std::size_t count = 1; ///< of numbers
  };
  enum class Data { ascii, binary, binary_compressed };

  std::vector<Field> fields;
  std::uint64_t width = 0, height = 0; ///< 0 where it does not say
  std::uint64_t points = 0;            ///< where it does not say, width times height
  Data data = Data::ascii;
  std::uint64_t lines = 0; ///< of the header

  /// Of a point, in a binary record.
  [[nodiscard]] std::size_t record_bytes() const;

  /// Whether a file with this first line is a PCD.
  static bool begins_with(const std::string& line);

  /// Leaves the stream at the first point. Fails with "line: what; what to do".
  static Expected<PcdHeader, std::string> read(std::istream& stream);
};

} // namespace locus
