// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <vector>

#include "locus_sim/dice.hpp"
#include "locus_sim/scene.hpp"
#include "locus_sim/trajectory.hpp"

namespace locus::sim {

/// How a robot goes, tenth by tenth of a second, for those who mean to stay with it.
struct Way {
  Stamp begin;
  std::vector<Eigen::Vector3d> ground_m; ///< below its middle, at each Track::kStep
  double reach_m;                        ///< from its middle to its side
  Ground height_m;                       ///< of the ground anywhere; none: level at 0

  Way(const Trajectory& trajectory, double reach_m_, Ground height_m_);

  [[nodiscard]] std::size_t steps() const { return ground_m.size(); }
  [[nodiscard]] Stamp stamp(std::size_t step) const { return begin + static_cast<Duration::rep>(step) * Track::kStep; }
  /// At a step, or at the last one.
  [[nodiscard]] Eigen::Vector2d at(std::size_t step) const {
    return ground_m[std::min(step, ground_m.size() - 1)].head<2>();
  }
  /// Without the swinging of its gait: mean velocity over a second.
  [[nodiscard]] Eigen::Vector2d velocity_mps(std::size_t step) const;
  [[nodiscard]] Eigen::Vector3d on_ground(const Eigen::Vector2d& place) const;
};

inline constexpr double kPersonalSpace_m = 0.5; ///< that people keep from the robot's side

/// People who stand and walk about the robot, up to 3 m from it, and go with it. They walk no faster than 1.8 m/s:
/// where the robot is faster they stay behind, and others wait for it farther on. They stay on this side of what stands
/// around, and off each other.
std::vector<Passer> company(const Scene& scene, const Way& way, std::size_t count, Dice& dice);

} // namespace locus::sim
