// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "core/base/isa.hpp"
#include "core/ingest/sweep.hpp"

namespace locus {

/// Gives the points of a sweep the normals of their surfaces.
///
/// The order of firing names the neighbours, so nothing is searched: before and after on the same scan line, and the
/// nearest three on the lines above and below, which the lidar fires within the same fraction of a millisecond. A plane
/// through them is trusted when they spread in two directions and little across; else the normal stays zero. One owner.
class ScanNormals {
 public:
  explicit ScanNormals(std::size_t max_points, Isa isa = best_isa());

  /// `points` sorted by scan line, within it by time (that is, by falling age). Writes normal_base, nothing else.
  void estimate(std::vector<SweepPoint>& points);

 private:
  struct Line {
    std::uint16_t id;
    std::size_t begin, end;
  };
  static constexpr std::size_t kMostNeighbours = 8;
  void find_lines(const std::vector<SweepPoint>& points);
  void find_neighbours(const std::vector<SweepPoint>& points, std::size_t line);
  void fit_planes(std::vector<SweepPoint>& points, std::size_t begin) const;

  Isa isa_;
  std::vector<Line> lines_;
  /// Places of the first neighbour of all points, of the second and so on; its own place where a point has fewer.
  std::array<std::vector<std::int32_t>, kMostNeighbours> neighbours_;
  std::vector<float> x_, y_, z_; ///< of the points
};

} // namespace locus
