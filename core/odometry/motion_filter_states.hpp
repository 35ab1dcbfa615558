// SPDX-License-Identifier: Apache-2.0
// Layout of the common states, and constants that several parts of the motion filter share.
#pragma once

#include "core/base/pose.hpp"
#include "core/odometry/joint_covariance.hpp"

namespace locus::motion_filter {

inline constexpr Block<3> kPosition{0};       ///< m, odom frame
inline constexpr Block<3> kTurn{3};           ///< rotation vector of the attitude error, rad, odom frame
inline constexpr Block<3> kVelocity{6};       ///< m/s, base frame
inline constexpr Block<3> kRate{9};           ///< rad/s, base frame
inline constexpr Block<3> kAccelerometer{12}; ///< bias, m/s^2, base axes
inline constexpr Block<3> kGravity{15};       ///< deviation from the standard one, m/s^2, odom frame
inline constexpr Block<3> kLever{18};         ///< deviation of the accelerometer's position, m, base axes
inline constexpr Block<6> kMap{21};           ///< pose error of the map since the start; considered, always zero

inline constexpr Block<6> kPose{kPosition.begin}, kTwist{kVelocity.begin};
inline constexpr int kForward = 0, kYawRate = 5; ///< axes of the twist

constexpr double square(double x) { return x * x; }

/// Returns variances of a tangent, from standard deviations of translation and rotation.
inline Vector6 squares(double translation, double rotation) {
  return (Vector6() << Eigen::Vector3d::Constant(square(translation)), Eigen::Vector3d::Constant(square(rotation)))
      .finished();
}

inline constexpr double kObservedRatio = 0.5; ///< an axis is observed if an update lowers its variance below this share
inline constexpr double kLateGyro_s = 0.003;  ///< jitter of a gyro's stamps
inline constexpr double kLever_m = 0.1;       ///< position error of a sensor, or of the point that it reports

/// Student's t, because wheels slip and visual odometry jumps more often than a Gaussian allows.
inline constexpr double kDegreesOfFreedom = 4.0;

} // namespace locus::motion_filter
