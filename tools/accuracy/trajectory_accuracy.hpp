// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "drivers/files/motion_files.hpp"

namespace locus {

/// Statistics of a set of errors as in the paper's Table II. The standard deviation is that of the population, as in
/// evo.
struct ErrorStatistics {
  double max = 0, mean = 0, std = 0, rmse = 0;
};
ErrorStatistics statistics_of(std::span<const double> errors);

/// Accuracy of a trajectory relative to the truth.
///
/// Compares the estimates whose stamps the truth spans; interpolates linearly in translation and by slerp in rotation.
/// Neither interpolates nor compares across a gap in the truth that is much longer than its usual interval.
struct TrajectoryAccuracy {
  std::vector<Stamp> stamps;             ///< of the estimates compared
  std::vector<double> position_error_m;  ///< of each estimate, after the SE(3) alignment (no scale) that minimises them
  ErrorStatistics ape_m;                 ///< statistics of these: the absolute position error
  std::optional<double> rpe_10m_percent; ///< mean translation error over all stretches of 10 m of the true path,
                                         ///< relative to their length; nothing if the robot drove less
  std::optional<double> rpe_10m_deg;     ///< mean rotation error over the same stretches
  double end_drift_m = 0;                ///< of the last pose, with the first poses aligned
  Pose T_truth_odom; ///< aligns positions and attitudes, so it is determined for a robot that stands or drives a line,
                     ///< too
};

/// Expects both sorted by time. Returns nothing if the truth spans no estimate. Any thread.
std::optional<TrajectoryAccuracy> trajectory_accuracy(std::span<const StampedPose> estimates,
                                                      std::span<const StampedPose> truth);

/// Drift of a trajectory as defined by KITTI's odometry benchmark (Geiger, Lenz, Urtasun: "Are We Ready for Autonomous
/// Driving?", CVPR 2012).
struct WayDrift {
  double way_m = 0;              ///< true path length between the first and the last estimate compared
  std::optional<double> percent; ///< mean translation error over stretches of 100, 200, ... 800 m, relative to their
                                 ///< length, starting at every tenth estimate; nothing on a shorter path
  std::optional<double> deg_per_100m; ///< mean rotation error over the same stretches
};

/// Expects both sorted by time. Returns nothing if the truth spans no estimate. Any thread.
std::optional<WayDrift> way_drift(std::span<const StampedPose> estimates, std::span<const StampedPose> truth);

} // namespace locus
