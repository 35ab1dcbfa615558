// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "drivers/files/motion_files.hpp"

namespace locus {

/// What the paper's Table II tells of a set of errors. The deviation is that of the set, as evo has it.
struct ErrorStatistics {
  double max = 0, mean = 0, std = 0, rmse = 0;
};
ErrorStatistics statistics_of(std::span<const double> errors);

/// How far a trajectory is from the truth.
///
/// An estimate is compared where the truth spans its stamp: interpolated, linear in translation and slerp in rotation.
/// Across a hole in the truth, much longer than its usual interval, nothing is interpolated and nothing compared.
struct TrajectoryAccuracy {
  std::vector<Stamp> stamps;             ///< of the estimates compared
  std::vector<double> position_error_m;  ///< of each, after the SE(3) alignment (no scale) that makes them least
  ErrorStatistics ape_m;                 ///< of these: the absolute position error
  std::optional<double> rpe_10m_percent; ///< mean error of translation over all stretches of 10 m of the true path, by
                                         ///< their length; nothing if the robot drove less
  std::optional<double> rpe_10m_deg;     ///< mean error of rotation over the same stretches
  double end_drift_m = 0;                ///< of the last pose, with the first poses aligned
  Pose T_truth_odom; ///< that fits positions and attitudes, so it is known for a robot that stands or drives a line too
};

/// Both in the order of time. Nothing where the truth spans no estimate. Any thread.
std::optional<TrajectoryAccuracy> trajectory_accuracy(std::span<const StampedPose> estimates,
                                                      std::span<const StampedPose> truth);

/// How far a trajectory goes astray on its way, as KITTI's odometry benchmark has it (Geiger, Lenz, Urtasun: "Are We
/// Ready for Autonomous Driving?", CVPR 2012).
struct WayDrift {
  double way_m = 0;                   ///< true, between the first and the last estimate compared
  std::optional<double> percent;      ///< mean error of translation over stretches of 100, 200, ... 800 m of it, by
                                      ///< their length, from every tenth estimate on; nothing on a shorter way
  std::optional<double> deg_per_100m; ///< mean error of rotation over the same stretches
};

/// Both in the order of time. Nothing where the truth spans no estimate. Any thread.
std::optional<WayDrift> way_drift(std::span<const StampedPose> estimates, std::span<const StampedPose> truth);

} // namespace locus
