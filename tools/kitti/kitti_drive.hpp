// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "core/base/expected.hpp"
#include "core/sources/motion_sample.hpp"
#include "drivers/files/motion_files.hpp"

namespace locus::tools {

/// Drive of KITTI's raw data: file names and times, readings of the inertial unit (oxts), and true poses.
/// `..._drive_NNNN_extract` has points as text and 100 records of the unit per second, `_sync` has binary points and
/// one record per sweep. The times are treated as UTC.
struct KittiDrive {
  struct Sweep {
    std::filesystem::path file;
    Stamp start, end;
  };

  std::vector<Sweep> sweeps;         ///< those with a file, sorted by number
  std::vector<ImuSample> imu;        ///< rotated into the lidar's axes; arrival = stamp
  std::vector<StampedPose> truth;    ///< of the lidar, relative to the unit's start, x east, y north
  std::vector<std::string> warnings; ///< one line each

  /// Returns whether this is a folder with velodyne_points/data.
  static bool is(const std::filesystem::path& folder);

  /// Reads everything but the points. A drive without oxts has neither imu nor truth. Fails with one line for the user.
  static Expected<KittiDrive, std::string> open(const std::filesystem::path& where);
};

} // namespace locus::tools
