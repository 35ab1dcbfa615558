// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "core/base/pose.hpp"
#include "core/ingest/sweep.hpp"

namespace locus {

/// Returns roll and pitch (rad) of a base with the up direction `up_base`; the yaw is zero.
Eigen::Vector3d level_rpy_rad(const Eigen::Vector3d& up_base);

/// Estimates the up direction from inertial sensors.
///
/// An attitude is used as it is. An accelerometer also measures the robot's own acceleration, so it is used only while
/// its magnitude is that of gravity. The estimate rotates with the robot and follows the measurement slowly. One owner.
class Gravity {
 public:
  /// Processes a sweep; the robot has rotated by R_last_now since the sweep before.
  void observe(const Eigen::Quaterniond& R_last_now, const Sweep& sweep);

  /// Returns the up direction, a unit vector in the base frame; nothing if the last sweep had no usable measurement.
  [[nodiscard]] std::optional<Eigen::Vector3d> up_base() const { return measured_ ? up_base_ : std::nullopt; }

 private:
  std::optional<Eigen::Vector3d> up_base_;
  bool measured_ = false; ///< in the last sweep
};

/// Keeps the odometry level over long distances: the drift of roll and pitch against gravity is removed gradually, from
/// keyframe to keyframe, so that a sweep is never tilted much against the map. One owner.
class TiltKeeper {
 public:
  void observe(const Eigen::Quaterniond& R_odom_base, const std::optional<Eigen::Vector3d>& up_base);

  /// Returns the rotation about the odom axes to apply to the next keyframe, and counts it as applied.
  Eigen::Vector3d pop_correction_rad();

 private:
  Eigen::Vector3d tilt_rad_ = Eigen::Vector3d::Zero(); ///< recent mean: rotation that would level the odometry
  double observed_ = 0.0;
};

} // namespace locus
