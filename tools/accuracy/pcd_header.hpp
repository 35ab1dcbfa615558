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

/// Reads a line without its end; nothing after the last, or if it is longer than any of a cloud, as in binary data.
std::optional<std::string> read_short_line(std::istream& stream);

/// Splits a line at blanks.
std::vector<std::string> words_of(const std::string& line);

/// Contents of the header of a PCD file.
struct PcdHeader {
  struct Field {
    std::string name;
    char type = 'F';       ///< F, U or I
    std::size_t bytes = 0; ///< per number: 1, 2, 4 or 8
    std::size_t count = 1; ///< numbers per field
  };
  enum class Data { ascii, binary, binary_compressed };

  std::vector<Field> fields;
  std::uint64_t width = 0, height = 0; ///< 0 if absent
  std::uint64_t points = 0;            ///< width times height if absent
  Data data = Data::ascii;
  std::uint64_t lines = 0; ///< header lines

  /// Size of a point in a binary record.
  [[nodiscard]] std::size_t record_bytes() const;

  /// Returns whether a file with this first line is a PCD.
  static bool begins_with(const std::string& line);

  /// Leaves the stream at the first point. Fails with "line: problem; remedy".
  static Expected<PcdHeader, std::string> read(std::istream& stream);
};

} // namespace locus
