// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include <cstddef>
#include <initializer_list>
#include <vector>

namespace locus::sim {

/// Road network of a world: straight lanes between places, in plan view. One owner.
class Roads {
 public:
  struct Lane {
    std::size_t from, to; ///< places; robots use it in both directions
  };

  /// Adds lanes from each place to the next; places closer than a millimetre are identical.
  void add(std::initializer_list<Eigen::Vector2d> polyline_m);

  [[nodiscard]] const std::vector<Eigen::Vector2d>& places_m() const { return places_m_; }
  [[nodiscard]] const std::vector<Lane>& lanes() const { return lanes_; }

  /// Returns the distance from a point to the middle of the nearest lane.
  [[nodiscard]] double distance_m(const Eigen::Vector2d& point) const;

 private:
  std::size_t place(const Eigen::Vector2d& at_m);

  std::vector<Eigen::Vector2d> places_m_;
  std::vector<Lane> lanes_;
};

} // namespace locus::sim
