// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "core/odometry/odometry_estimate.hpp"
#include "core/sources/motion_sources.hpp"

namespace locus::daemon {

/// Predicted state of the base between two estimates or after the last one.
struct FastSample {
  Stamp stamp;
  Pose T_odom_base;
  Matrix6 pose_covariance = Matrix6::Zero();  ///< x, y, z and rotations about the odom axes
  Vector6 twist_base = Vector6::Zero();       ///< m/s and rad/s, base frame
  Matrix6 twist_covariance = Matrix6::Zero(); ///< base frame
};

/// Propagates the last estimate with each sample of the rotation source, the fastest of those chosen. Beyond the last
/// measured translation the motion is an arc of constant twist. Continues without lidar, since dead reckoning gives
/// estimates, too. One owner, the ingest thread.
class FastOdometry {
 public:
  void set_estimate(const FastSample& estimate) { estimate_ = estimate; }

  /// Predicts the state after a sample of `source`. Empty for other sources, while no source is healthy, and before the
  /// first estimate.
  [[nodiscard]] std::optional<FastSample> predict(const MotionSources& sources, SourceId source, Stamp arrival) const;

 private:
  std::optional<FastSample> estimate_;
};

} // namespace locus::daemon
