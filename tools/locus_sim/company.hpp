// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <vector>

#include "locus_sim/dice.hpp"
#include "locus_sim/scene.hpp"
#include "locus_sim/trajectory.hpp"

namespace locus::sim {

/// Path of a robot, sampled every tenth of a second, for those who accompany it.
struct Way {
  Stamp begin;
  std::vector<Eigen::Vector3d> ground_m; ///< below its centre, at each Track::kStep
  double reach_m;                        ///< from its centre to its side
  Ground height_m;                       ///< ground anywhere; none: level at 0

  Way(const Trajectory& trajectory, double reach_m_, Ground height_m_);

  [[nodiscard]] std::size_t steps() const { return ground_m.size(); }
  [[nodiscard]] Stamp stamp(std::size_t step) const { return begin + static_cast<Duration::rep>(step) * Track::kStep; }
  /// Returns the position at a step, or at the last one.
  [[nodiscard]] Eigen::Vector2d at(std::size_t step) const {
    return ground_m[std::min(step, ground_m.size() - 1)].head<2>();
  }
  /// Returns the mean velocity over a second, without the oscillation of the gait.
  [[nodiscard]] Eigen::Vector2d velocity_mps(std::size_t step) const;
  [[nodiscard]] Eigen::Vector3d on_ground(const Eigen::Vector2d& place) const;
};

inline constexpr double kPersonalSpace_m = 0.5; ///< kept from the robot's side

/// Simulates people who stand and walk up to 3 m from the robot and accompany it. They walk at most at 1.8 m/s: a
/// faster robot leaves them behind, and others wait farther along its path. They stay on the robot's side of obstacles,
/// and off each other.
std::vector<Passer> company(const Scene& scene, const Way& way, std::size_t count, Dice& dice);

} // namespace locus::sim
