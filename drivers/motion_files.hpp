// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "core/expected.hpp"
#include "core/motion_sample.hpp"

namespace locus {

/// Readers of recorded motion. All skip blank lines and lines that start with #, accept CRLF, and give the samples in
/// the order of their arrival: that of STEM.meta.csv (`t_ns,arrival_ns,covariance_scale`) beside the file where there
/// is one, else arrival = stamp. NaN passes, as it does from a live sensor. Text that is no number is an error, one
/// line for the user: `file:line: what; what to do`. Any thread.

/// EuRoC's IMU table with an optional attitude and an optional header line, rad/s and m/s^2:
/// `t_ns,wx,wy,wz,ax,ay,az[,qw,qx,qy,qz]`.
Expected<std::vector<ImuSample>, std::string> read_imu(const std::filesystem::path& file);

/// TUM's trajectory table, seconds and metres: `t x y z qx qy qz qw`. The nanoseconds of the time are kept.
Expected<std::vector<OdometrySample>, std::string> read_odometry(const std::filesystem::path& file);

/// Where the base was at one instant.
struct StampedPose {
  Stamp stamp;
  Pose T_source_base; ///< in the frame of whoever says so
};

/// The same table as something to measure by, so more is asked of it: finite, in the order of time, at least one pose.
Expected<std::vector<StampedPose>, std::string> read_trajectory(const std::filesystem::path& file);

} // namespace locus
