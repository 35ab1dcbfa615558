// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "core/base/isa.hpp"
#include "core/ingest/sweep.hpp"

namespace locus {

/// Estimates the surface normals of the points of a sweep.
///
/// The order of firing determines the neighbours, so there is no search: the previous and the next point on the same
/// scan line, and the nearest three on the lines above and below, which are fired within the same fraction of a
/// millisecond. A plane through them is accepted if they spread in two directions and little across it; otherwise the
/// normal stays zero. One owner.
class ScanNormals {
 public:
  explicit ScanNormals(std::size_t max_points, Isa isa = best_isa());

  /// Writes normal_base and nothing else. `points` must be sorted by scan line, then by time (that is, by falling age).
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
  /// Indices of the first neighbours of all points, of the second ones and so on; a point with fewer is its own
  /// neighbour.
  std::array<std::vector<std::int32_t>, kMostNeighbours> neighbours_;
  std::vector<float> x_, y_, z_; ///< coordinates of the points
};

} // namespace locus
