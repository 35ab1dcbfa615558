// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "core/base/expected.hpp"
#include "drivers/files/motion_files.hpp"
#include "sweep_folder/sweep_points.hpp"

namespace locus::tools {

/// Recording in a folder with a file of points (.pcd or .bin) for each sweep: everything but the points.
///
/// | layout | sweeps | times | else |
/// |---|---|---|---|
/// | KITTI's odometry benchmark | velodyne/ | times.txt | calib.txt; ../../poses/NAME.txt: true poses of camera 0 |
/// | like EuRoC's | lidar0/data/ or lidar0/ | data.csv, times.txt or timestamps.txt | imu0 and truth, see below |
/// | sweeps only | itself or data/ | as above | as above, in it or next to it |
///
/// IMU and truth like EuRoC's: imu0/data.csv and state_groundtruth_estimate0/data.csv. The table of times is next to
/// the sweeps, above their folder, or in the recording; without one the names of the sweeps are the times. Names of
/// sweeps begin with a digit.
struct SweepFolder {
  struct Sweep {
    std::filesystem::path file;
    Stamp stamp;
  };

  std::filesystem::path folder;   ///< holds the sweeps
  std::vector<Sweep> sweeps;      ///< sorted by stamp; at least one
  Duration step{};                ///< usual interval
  bool is_kitti = false;          ///< KITTI has de-skewed its points to one instant
  bool is_hdl64 = false;          ///< likewise, and they are in the order of KITTI's lidar
  std::vector<StampedPose> truth; ///< of the lidar, or of the body of EuRoC's truth

  /// Checks names only.
  static bool is(const std::filesystem::path& where);
  static bool is_kitti_odometry(const std::filesystem::path& where);
  /// Returns whether the points of the first readable sweep are in the order of KITTI's own lidar.
  static bool is_of_hdl64(const std::filesystem::path& where);
  /// Returns imu0/data.csv, if it exists.
  static std::optional<std::filesystem::path> imu_of(const std::filesystem::path& where);
  /// Lists all folders in which a new file would become part of the recording.
  static std::vector<std::filesystem::path> folders_of(const std::filesystem::path& where);

  /// Reads everything but the points. Fails with one line for the user. Precondition: is(where).
  static Expected<SweepFolder, std::string> open(const std::filesystem::path& where);

  /// Reads the points of a sweep; see read_pcd_points(). `raised_deg` applies if is_hdl64.
  std::optional<std::string> read(const Sweep& sweep, double raised_deg, SweepPoints& points) const;
};

} // namespace locus::tools
