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

/// All returns of each sweep where they lay at its end, base frame, a file each: 000000.pcd and so on, fields as those
/// of daemon::CloudMessage; .bin is KITTI's, x y z and the intensity from 0 to 1 as float32. Line N, counted from 0, of
/// times.txt is the stamp of sweep N in seconds, that of poses.txt T_odom_base, the upper three rows of its matrix as
/// KITTI writes them.
///
/// One sweep is in memory at a time. One owner.
class SweepFiles {
 public:
  /// Makes the folder, in which there is nothing. Throws Failure, as do the others.
  SweepFiles(const std::filesystem::path& folder, CloudFormat format);

  /// Right after the sweep was processed, with its returns (SweepOptions::keeps_returns).
  void take(const Sweep& sweep, const Odometry& odometry, const OdometryEstimate& estimate);
  void close();

 private:
  void write_points(const std::filesystem::path& file);
  void write_bin(const std::filesystem::path& path) const;

  std::filesystem::path folder_;
  CloudFormat format_;
  OutputFile times_, poses_;
  std::size_t sweeps_ = 0;
  std::vector<SurfacePoint> placed_; ///< of the sweep at hand
  std::vector<daemon::CloudMessage::Point> points_;
};

} // namespace locus::tools
