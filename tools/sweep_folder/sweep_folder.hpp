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

/// A recording that is a folder with a file of points (.pcd or .bin) for each sweep, as far as it is of use but for the
/// points.
///
/// | layout | sweeps | times | else |
/// |---|---|---|---|
/// | KITTI's odometry benchmark | velodyne/ | times.txt | calib.txt; ../../poses/NAME.txt: true poses of camera 0 |
/// | like EuRoC's | lidar0/data/ or lidar0/ | data.csv, times.txt or timestamps.txt | imu0/data.csv;
/// state_groundtruth_estimate0/data.csv | | sweeps alone | itself or data/ | the same | the same, in it or beside it |
///
/// The table of times lies beside the sweeps, above their folder, or in the recording; without one the names of the
/// sweeps are the times. Names of sweeps begin with a digit.
struct SweepFolder {
  struct Sweep {
    std::filesystem::path file;
    Stamp stamp;
  };

  std::filesystem::path folder;   ///< of the sweeps
  std::vector<Sweep> sweeps;      ///< in the order of their stamps; at least one
  Duration step{};                ///< from one to the next, mostly
  bool is_kitti = false;          ///< its points are those of one instant: KITTI has taken the motion out of them
  bool is_hdl64 = false;          ///< the same, and they lie in the order of KITTI's lidar
  std::vector<StampedPose> truth; ///< of the lidar, or of what the truth of EuRoC is of

  /// Looks at names alone.
  static bool is(const std::filesystem::path& where);
  static bool is_kitti_odometry(const std::filesystem::path& where);
  /// Whether the points of the first sweep that can be read lie in the order of KITTI's own lidar.
  static bool is_of_hdl64(const std::filesystem::path& where);
  /// imu0/data.csv, where there is one.
  static std::optional<std::filesystem::path> imu_of(const std::filesystem::path& where);
  /// All that a file put into would be a part of the recording.
  static std::vector<std::filesystem::path> folders_of(const std::filesystem::path& where);

  /// Reads all but the points. Fails with one line for the user. Precondition: is(where).
  static Expected<SweepFolder, std::string> open(const std::filesystem::path& where);

  /// Reads the points of a sweep; see read_pcd_points(). `raised_deg` is for what is_hdl64.
  std::optional<std::string> read(const Sweep& sweep, double raised_deg, SweepPoints& points) const;
};

} // namespace locus::tools
