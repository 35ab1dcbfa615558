// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>
#include <unordered_map>
#include <utility>
#include <vector>

#include <Eigen/Core>

namespace locus {

/// Exact distances from each of a few points to the nearest of many candidates, which are streamed. Memory grows with
/// the few only. One owner.
class NearestDistances {
 public:
  /// Ignores candidates farther than `reach_m` from a point. `points` must outlive this.
  NearestDistances(std::span<const Eigen::Vector3f> points, float reach_m);

  /// Adds one of the many candidates.
  void offer(const Eigen::Vector3f& candidate);

  /// Returns the distance of each point, in metres; infinite if no candidate was within reach.
  [[nodiscard]] std::vector<float> distances_m() const;

 private:
  using Cell = std::uint64_t;
  /// Points whose reach overlaps the cell.
  using Members = std::span<const std::uint32_t>;

  [[nodiscard]] Cell cell_of(const Eigen::Vector3f& position) const;

  std::span<const Eigen::Vector3f> points_;
  float reach_m_;
  std::vector<float> squared_m2_;
  std::vector<std::uint32_t> members_; ///< grouped by cell
  std::unordered_map<Cell, Members> cells_;
  std::pair<Cell, Members> latest_{~Cell{0}, {}}; ///< cache: maps are written surface by surface
};

} // namespace locus
