// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include <filesystem>
#include <string>
#include <vector>

#include "drivers/files/motion_files.hpp"

namespace locus::experiments {

/// Used columns of a row of odometry.csv.
struct OdometryRow {
  std::string state;
  Eigen::Matrix2d covariance_m2; ///< of x and y of odom

  /// Returns whether the estimate is flagged.
  [[nodiscard]] bool flagged() const { return state == "degenerate" || state == "dead_reckoning"; }
};

/// Output of a run of locus-replay: each estimate with its row.
struct OdometryRows {
  std::vector<StampedPose> estimates;
  std::vector<OdometryRow> rows; ///< one per estimate
};

/// Reads odometry.tum and odometry.csv of a run's folder. Throws tools::Failure.
OdometryRows read_odometry(const std::filesystem::path& run_folder);

/// Reads a file of poses. Throws tools::Failure.
std::vector<StampedPose> read_poses(const std::filesystem::path& file);

} // namespace locus::experiments
