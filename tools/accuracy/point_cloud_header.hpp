// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <istream>
#include <string>

#include "core/base/expected.hpp"

namespace locus {

/// Location of the coordinates in a PLY or PCD file.
struct PointCloudLayout {
  enum class Encoding { text, little_endian, big_endian };
  struct Coordinate {
    std::size_t column = 0; ///< index in a line of text
    std::size_t offset = 0; ///< from the start of a binary record
    std::size_t bytes = 0;  ///< 4: float, 8: double
  };

  Encoding encoding = Encoding::text;
  std::uint64_t points = 0;
  std::size_t record_bytes = 0; ///< per point
  std::array<Coordinate, 3> xyz;
  std::uint64_t header_lines = 0;

  /// Leaves the stream at the first point. Fails with "line: problem; remedy".
  static Expected<PointCloudLayout, std::string> read(std::istream& stream);
};

} // namespace locus
