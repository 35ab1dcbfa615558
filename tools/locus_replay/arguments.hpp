// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "core/base/stamp.hpp"
#include "faults/fault.hpp"
#include "locus_replay/cloud_files.hpp"

namespace locus::tools {

inline constexpr double kLongest_s = 1e8; ///< that a recording may last: three years

/// What the user asked for.
struct Arguments {
  struct OdometryFile {
    std::string name; ///< of the motion source
    std::filesystem::path file;
  };

  std::filesystem::path capture;
  std::filesystem::path output;
  std::filesystem::path config; ///< empty: that of the capture folder, or the defaults
  std::vector<std::string> overrides;
  std::filesystem::path imu; ///< empty: that of the capture folder
  std::vector<OdometryFile> odometry;
  std::filesystem::path ground_truth; ///< empty: that of the capture folder
  std::filesystem::path map_truth;    ///< the same
  std::filesystem::path mcap;         ///< to be written; empty: none
  std::filesystem::path calibrate;    ///< the same
  std::filesystem::path sweeps;       ///< folder to be filled; empty: none
  CloudFormat sweeps_format = CloudFormat::pcd;
  Duration start{};
  std::optional<Duration> duration;
  std::vector<Fault> faults;
  std::optional<double> realtime_speed;
  bool kitti_as_published = false; ///< the points of a drive of KITTI stay as they are
  bool quiet = false;
};

/// Nothing where help or version were asked for and have been printed. Throws Failure.
std::optional<Arguments> parse_arguments(int argc, char** argv);

} // namespace locus::tools
