// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>
#include <unordered_map>
#include <utility>
#include <vector>

#include <Eigen/Core>

namespace locus {

/// How far each of some points is from the nearest of many more, of which one after the other passes by: exact, with
/// memory for the few alone. One owner.
class NearestDistances {
 public:
  /// Nothing farther than `reach_m` from a point is looked at. `points` must outlive this.
  NearestDistances(std::span<const Eigen::Vector3f> points, float reach_m);

  /// One of the many.
  void offer(const Eigen::Vector3f& candidate);

  /// Of each point, in metres; infinite where nothing was within reach.
  [[nodiscard]] std::vector<float> distances_m() const;

 private:
  using Cell = std::uint64_t;
  /// Points in whose reach at least a part of the cell lies.
  using Members = std::span<const std::uint32_t>;

  [[nodiscard]] Cell cell_of(const Eigen::Vector3f& position) const;

  std::span<const Eigen::Vector3f> points_;
  float reach_m_;
  std::vector<float> squared_m2_;
  std::vector<std::uint32_t> members_; ///< of cell after cell
  std::unordered_map<Cell, Members> cells_;
  std::pair<Cell, Members> latest_{~Cell{0}, {}}; ///< maps are written surface by surface: the next is mostly the same
};

} // namespace locus
