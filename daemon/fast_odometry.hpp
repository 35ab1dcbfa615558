// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "core/odometry/odometry_estimate.hpp"
#include "core/sources/motion_sources.hpp"

namespace locus::daemon {

/// Where the base is between two estimates, or after the last one.
struct FastSample {
  Stamp stamp;
  Pose T_odom_base;
  Matrix6 pose_covariance = Matrix6::Zero();  ///< of x, y, z and turns about the odom axes
  Vector6 twist_base = Vector6::Zero();       ///< m/s and rad/s, base frame
  Matrix6 twist_covariance = Matrix6::Zero(); ///< base frame
};

/// Carries the last estimate forward with each sample of the source that gives the rotation, the quickest of those
/// chosen. Between the last translation that was measured and now the base moves with a constant twist: on an arc. Goes
/// on without lidar: dead reckoning gives estimates, too. One owner, the ingest thread.
class FastOdometry {
 public:
  void take(const FastSample& estimate) { estimate_ = estimate; }

  /// After a sample of `source`; nothing for other sources, and while none is healthy or nothing has been estimated.
  [[nodiscard]] std::optional<FastSample> carry(const MotionSources& sources, SourceId source, Stamp arrival) const;

 private:
  std::optional<FastSample> estimate_;
};

} // namespace locus::daemon
