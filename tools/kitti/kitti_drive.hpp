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

/// A drive of KITTI's raw data as far as it is of use: names and times, what the inertial unit (oxts) said, and where
/// it was. `..._drive_NNNN_extract` has points as text and 100 records of the unit in a second, `_sync` has points in
/// binary and a record for each sweep. The times are taken as UTC.
struct KittiDrive {
  struct Sweep {
    std::filesystem::path file;
    Stamp start, end;
  };

  std::vector<Sweep> sweeps;         ///< that have a file, in the order of their numbers
  std::vector<ImuSample> imu;        ///< turned into the lidar's axes; arrival = stamp
  std::vector<StampedPose> truth;    ///< of the lidar, from where the unit began, x to the east, y to the north
  std::vector<std::string> warnings; ///< a line each

  /// A folder with velodyne_points/data.
  static bool is(const std::filesystem::path& folder);

  /// Reads all but the points. A drive without oxts has neither imu nor truth. Fails with one line for the user.
  static Expected<KittiDrive, std::string> open(const std::filesystem::path& where);
};

} // namespace locus::tools
