// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "core/base/pose.hpp"
#include "core/ingest/sweep.hpp"

namespace locus {

/// Roll and pitch (rad) of a base that has `up_base` above it; the yaw is zero.
Eigen::Vector3d level_rpy_rad(const Eigen::Vector3d& up_base);

/// Which way is up, from inertial sensors.
///
/// An attitude is taken at its word. An accelerometer alone also feels the robot's own acceleration, so what is up
/// turns with the robot and gives in to the accelerometer slowly, and only where that reads as much as gravity. One
/// owner.
class Gravity {
 public:
  /// The robot has turned by R_last_now since the sweep before.
  void observe(const Eigen::Quaterniond& R_last_now, const Sweep& sweep);

  /// Unit vector in the base frame; nothing where the last sweep came without a measurement that can be used.
  [[nodiscard]] std::optional<Eigen::Vector3d> up_base() const { return measured_ ? up_base_ : std::nullopt; }

 private:
  std::optional<Eigen::Vector3d> up_base_;
  bool measured_ = false; ///< by the last sweep
};

/// Keeps the odometry level over long ways: what roll and pitch have drifted against gravity is taken back little by
/// little, from keyframe to keyframe, so that no sweep meets a map that leans much against it. One owner.
class TiltKeeper {
 public:
  void observe(const Eigen::Quaterniond& R_odom_base, const std::optional<Eigen::Vector3d>& up_base);

  /// By how much the next keyframe is to be turned about the odom axes. Counts as done.
  Eigen::Vector3d take_correction_rad();

 private:
  Eigen::Vector3d tilt_rad_ = Eigen::Vector3d::Zero(); ///< mean of late: the turn that would right the odometry
  double observed_ = 0.0;
};

} // namespace locus
