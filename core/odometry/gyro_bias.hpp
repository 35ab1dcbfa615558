// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include "core/base/stamp.hpp"

namespace locus {

/// The turn rate that a gyro reads at rest, learned from what lidar sees while the robot stands or turns slowly. One
/// owner.
class GyroBias {
 public:
  /// The robot turned by `true_turn_rad`, and `excess_rad` more was read than that and what was known. Base axes.
  void learn(const Eigen::Vector3d& excess_rad, const Eigen::Vector3d& true_turn_rad, Duration elapsed);

  /// What is read of a robot at rest. Base axes.
  [[nodiscard]] Eigen::Vector3d turn_rad(Duration elapsed) const { return to_seconds(elapsed) * rate_radps_; }

 private:
  Eigen::Vector3d rate_radps_ = Eigen::Vector3d::Zero();
  double learned_ = 0.0;
};

} // namespace locus
