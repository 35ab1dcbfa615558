// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <vector>

#include "core/sweep.hpp"

namespace locus {

/// Gives the points of a sweep the normals of their surfaces.
///
/// The order of firing names the neighbours, so nothing is searched: before and after on the same scan line, and the
/// nearest three on the lines above and below, which the lidar fires within the same fraction of a millisecond. A plane
/// through them is trusted when they spread in two directions and little across; else the normal stays zero. One owner.
class ScanNormals {
 public:
  explicit ScanNormals(std::size_t max_points) { lines_.reserve(max_points); }

  /// `points` sorted by scan line, within it by time (that is, by falling age). Writes normal_base, nothing else.
  void estimate(std::vector<SweepPoint>& points);

 private:
  struct Line {
    std::uint16_t id;
    std::size_t begin, end;
  };
  std::vector<Line> lines_;
};

} // namespace locus
