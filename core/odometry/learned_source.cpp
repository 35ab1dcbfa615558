// SPDX-License-Identifier: Apache-2.0
#include "core/odometry/learned_source.hpp"

#include "core/odometry/motion_filter_states.hpp"

namespace locus {

namespace {

/// Prior noise of the sources: variance of position (m) and rotation (rad) after one second.
const Vector6 kOdometryNoise = motion_filter::squares(0.02, 0.01);
const Vector6 kGyroNoise = motion_filter::squares(1.0, 0.006);

/// Prior standard deviations of the calibration.
constexpr double kGyroBias = 0.02;      ///< rad/s
constexpr double kLate_s = 0.015;       ///< lateness of a gyro's stamps
constexpr double kMounting_rad = 0.015; ///< deviation of a gyro's mounting from the configuration
constexpr double kScale = 0.02;
constexpr double kDirection_rad = 0.01; ///< misalignment of an odometry's forward axis

} // namespace

LearnedSource as_configured(const MotionSourceOptions& source) {
  const CalibrationSigma& configured = source.calibration_sigma;
  LearnedSource known;
  LearnedSource::States sigma;
  if (source.kind == SourceKind::imu) {
    const double late = configured.late_ms ? 1e-3 * *configured.late_ms : kLate_s;
    const double mounting = configured.mounting_deg ? kRadPerDeg * *configured.mounting_deg : kMounting_rad;
    known.states[LearnedSource::kLate] = 1e-3 * source.late_ms;
    sigma << kGyroBias, kGyroBias, kGyroBias, late, mounting, mounting, mounting;
  } else {
    known.states.head<2>() << source.scale - 1.0, source.yaw_scale - 1.0;
    sigma << configured.scale.value_or(kScale), configured.yaw_scale.value_or(kScale), kDirection_rad, kDirection_rad,
        0, 0, 0;
  }
  known.covariance.diagonal() = sigma.cwiseAbs2();
  known.noise_per_s = source.kind == SourceKind::imu ? kGyroNoise : kOdometryNoise;
  return known;
}

Pose LearnedSource::without_scale(const Pose& way) const {
  return {way.rotation, way.translation / (1.0 + states[kScale])};
}

} // namespace locus
