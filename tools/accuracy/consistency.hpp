// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <span>

#include "core/base/pose.hpp"
#include "drivers/files/motion_files.hpp"

namespace locus {

/// Whether estimates are off by as much as their covariances say.
struct Consistency {
  /// Mean over all stretches of 10 m of the squared error of their relative pose by its covariance: of six axes that
  /// say the truth, 6. Both ends are taken to be off independently, as those of a robot are that finds its place in a
  /// map at each; what they share, as the drift since the start, makes the mean smaller. Nothing if the robot drove
  /// less.
  std::optional<double> nees_10m;
  /// The largest error of a position, with the first poses aligned, in standard deviations along its axis. An error of
  /// less than a centimetre counts as none.
  double worst_sigma = 0;
};

/// `covariances` of the estimates since the start, as in OdometryEstimate::pose_covariance. Nothing where the truth
/// spans no estimate. Any thread.
std::optional<Consistency> consistency(std::span<const StampedPose> estimates, std::span<const Matrix6> covariances,
                                       std::span<const StampedPose> truth);

} // namespace locus
