// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include "core/base/options.hpp"
#include "core/base/pose.hpp"
#include "core/base/stamp.hpp"
#include "core/sources/sensed_motion.hpp"

namespace locus {

/// Estimate of a calibration parameter, and its standard deviation.
struct Learned {
  double mean = 0.0, sigma = 0.0;
};

/// Calibration and noise of a motion source, for the filter of another run to start with. States: three biases, the
/// lateness and three mounting angles (rotation vector) of a gyro, or two scales and two directions of an odometry.
struct LearnedSource {
  static constexpr int kMostStates = 7;
  using States = Eigen::Matrix<double, kMostStates, 1>; ///< the first four for an odometry; the rest is zero
  using Covariance = Eigen::Matrix<double, kMostStates, kMostStates>;
  static constexpr int kLate = 3, kMounting = 4;                 ///< of a gyro, after its biases
  static constexpr int kScale = 0, kYawScale = 1, kLeftward = 2; ///< of an odometry; its upward direction is last

  Vector6 noise_per_s = Vector6::Zero(); ///< variance of its mean twist over one second
  States states = States::Zero();
  Covariance covariance = Covariance::Zero();
  Stamp since{}; ///< end of the first sweep with a sample of it

  /// Returns the delay of a gyro's stamps after the motion, in seconds.
  [[nodiscard]] Learned lateness_s() const { return figure(kLate); }
  /// Returns a gyro's mounting error relative to the configuration, about an axis of the base (0 to 2).
  [[nodiscard]] Learned mounting_rad(int axis) const { return figure(kMounting + axis); }
  /// Returns an odometry's relative excess of reported forward distance, and of yaw.
  [[nodiscard]] Learned scale() const { return figure(kScale); }
  [[nodiscard]] Learned yaw_scale() const { return figure(kYawScale); }
  /// Returns the motion of the base for a motion reported by an odometry, with the scale removed. Exact for any path if
  /// the rotation is right.
  [[nodiscard]] Pose without_scale(const Pose& way) const;

 private:
  [[nodiscard]] Learned figure(int state) const {
    return {states[state], std::sqrt(std::max(0.0, covariance(state, state)))};
  }
};

/// Returns the prior of a source: its configured calibration and the uncertainty of that.
LearnedSource as_configured(const MotionSourceOptions& source);

/// Indexed by source; empty for sources that have not been received.
using LearnedSources = std::array<std::optional<LearnedSource>, kMaxSources>;

} // namespace locus
