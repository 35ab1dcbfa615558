// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <filesystem>
#include <vector>

#include "core/base/surface_point.hpp"
#include "core/ingest/sweep.hpp"
#include "core/odometry/odometry.hpp"
#include "daemon/dds/ros_messages.hpp"
#include "locus_replay/cloud_files.hpp"
#include "locus_replay/output_file.hpp"

namespace locus::tools {

/// Writes all returns of each sweep, de-skewed to its end, base frame, a file each: 000000.pcd and so on, with the
/// fields of daemon::CloudMessage; .bin is KITTI's, x y z and the intensity from 0 to 1 as float32. Line N, counted
/// from 0, of times.txt is the stamp of sweep N in seconds, that of poses.txt T_odom_base, the upper three rows of its
/// matrix as in KITTI.
///
/// One sweep is in memory at a time. One owner.
class SweepFiles {
 public:
  /// Creates the folder. Precondition: it is missing or empty. Throws Failure, as do the other methods.
  SweepFiles(const std::filesystem::path& folder, CloudFormat format);

  /// Writes a sweep with its returns (SweepOptions::keeps_returns). Call right after it was processed.
  void write(const Sweep& sweep, const Odometry& odometry, const OdometryEstimate& estimate);
  void close();

 private:
  void write_points(const std::filesystem::path& file);
  void write_bin(const std::filesystem::path& path) const;

  std::filesystem::path folder_;
  CloudFormat format_;
  OutputFile times_, poses_;
  std::size_t sweeps_ = 0;
  std::vector<SurfacePoint> placed_; ///< of the current sweep
  std::vector<daemon::CloudMessage::Point> points_;
};

} // namespace locus::tools
