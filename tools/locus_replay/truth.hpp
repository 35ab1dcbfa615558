// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "accuracy/point_cloud_file.hpp"
#include "core/map/surface_map.hpp"
#include "core/odometry/odometry_estimate.hpp"
#include "drivers/files/capture_folder.hpp"
#include "locus_replay/arguments.hpp"
#include "locus_replay/progress_bar.hpp"
#include "locus_replay/run_figures.hpp"

namespace locus::tools {

/// The truth that the user or the folder gave, and what of a run is compared with it. One owner.
class Truth {
 public:
  /// Reads the poses and looks at the map, so that what is wrong with them is known before the run. `recorded`: the
  /// poses where there is no file. Throws Failure.
  Truth(const Arguments& arguments, const CaptureFolder& folder, std::vector<StampedPose> recorded);

  void take(const OdometryEstimate& estimate);

  /// Empty if there is none.
  [[nodiscard]] std::span<const StampedPose> trajectory() const { return trajectory_; }

  /// Takes its time if there is a map. Once: the covariances are given up first, 10 MB of an hour's drive.
  [[nodiscard]] Accuracy compare(std::span<const SurfacePoint> map, bool show_progress);

 private:
  [[nodiscard]] std::string why_nothing_in_common() const;

  std::filesystem::path trajectory_file_, map_file_; ///< empty: none
  std::vector<StampedPose> trajectory_;
  std::optional<PointCloudFile> map_;
  std::vector<StampedPose> estimates_; ///< with a true trajectory alone
  std::vector<Matrix6> covariances_;   ///< of these
};

} // namespace locus::tools
