// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <span>

#include "core/base/pose.hpp"
#include "drivers/files/motion_files.hpp"

namespace locus {

/// Consistency of the errors of estimates with their covariances.
struct Consistency {
  /// Mean NEES of the relative pose over all stretches of 10 m; 6 (six axes) if the covariances are correct. The errors
  /// of both ends count as independent, as those of a robot that localises in a map at each end; errors in common, such
  /// as the drift since the start, make the mean smaller. Nothing if the robot drove less.
  std::optional<double> nees_10m;
  /// Largest position error, with the first poses aligned, in standard deviations along its axis. Errors below a
  /// centimetre count as zero.
  double worst_sigma = 0;
};

/// Evaluates `covariances` of the estimates since the start, as in OdometryEstimate::pose_covariance. Returns nothing
/// if the truth spans no estimate. Any thread.
std::optional<Consistency> consistency(std::span<const StampedPose> estimates, std::span<const Matrix6> covariances,
                                       std::span<const StampedPose> truth);

} // namespace locus
