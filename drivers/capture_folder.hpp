// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "core/expected.hpp"

namespace locus {

/// The files of a recording, by their fixed names.
struct CaptureFolder {
  struct Source {
    std::string name;
    std::filesystem::path file;
  };

  std::filesystem::path lidar;        ///< lidar.pcap or lidar.pcapng
  std::filesystem::path imu;          ///< imu.csv; this and the next three are empty where the folder has none
  std::filesystem::path ground_truth; ///< gt.tum
  std::filesystem::path map_truth;    ///< gt_map.ply
  std::filesystem::path config;       ///< config.yaml
  std::vector<Source> odometry;       ///< every other *.tum, by name

  /// Looks at names alone and opens nothing. A file is taken for the capture itself. Fails with one line for the user.
  static Expected<CaptureFolder, std::string> find(const std::filesystem::path& where);
};

} // namespace locus
