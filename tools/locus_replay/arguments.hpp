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

inline constexpr double kLongest_s = 1e8; ///< limit on the length of a recording: three years

/// Command line arguments.
struct Arguments {
  struct OdometryFile {
    std::string name; ///< of the motion source
    std::filesystem::path file;
  };

  std::filesystem::path capture;
  std::filesystem::path output;
  std::filesystem::path config; ///< empty: as in the capture folder, or the defaults
  std::vector<std::string> overrides;
  std::filesystem::path imu; ///< empty: as in the capture folder
  std::vector<OdometryFile> odometry;
  std::filesystem::path ground_truth; ///< empty: as in the capture folder
  std::filesystem::path map_truth;    ///< empty: as in the capture folder
  std::filesystem::path mcap;         ///< output; empty: none
  std::filesystem::path calibrate;    ///< output; empty: none
  std::filesystem::path sweeps;       ///< output folder; empty: none
  CloudFormat sweeps_format = CloudFormat::pcd;
  Duration start{};
  std::optional<Duration> duration;
  std::vector<Fault> faults;
  std::optional<double> realtime_speed;
  bool kitti_as_published = false; ///< leaves the points of a KITTI drive uncorrected
  bool discover = false;           ///< prints the configuration and replays nothing
  bool quiet = false;
};

/// Returns nothing if help or version were requested and have been printed. Throws Failure.
std::optional<Arguments> parse_arguments(int argc, char** argv);

} // namespace locus::tools
