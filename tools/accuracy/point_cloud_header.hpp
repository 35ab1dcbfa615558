// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <istream>
#include <string>

#include "core/base/expected.hpp"

namespace locus {

/// Where in a PLY or PCD file the coordinates of the points lie.
struct PointCloudLayout {
  enum class Encoding { text, little_endian, big_endian };
  struct Coordinate {
    std::size_t column = 0; ///< in a line of text
    std::size_t offset = 0; ///< in a binary record
    std::size_t bytes = 0;  ///< 4: float, 8: double
  };

  Encoding encoding = Encoding::text;
  std::uint64_t points = 0;
  std::size_t record_bytes = 0; ///< of a point
  std::array<Coordinate, 3> xyz;
  std::uint64_t header_lines = 0;

  /// Leaves the stream at the first point. Fails with "line: what; what to do".
  static Expected<PointCloudLayout, std::string> read(std::istream& stream);
};

} // namespace locus
