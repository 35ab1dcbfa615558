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
#include "locus_replay/clock_follower.hpp"
#include "locus_replay/progress_bar.hpp"
#include "locus_replay/run_figures.hpp"

namespace locus::tools {

/// Truth from the user or the folder, and the run's data to compare with it. One owner.
class Truth {
 public:
  /// Reads the poses and checks the map, so that mistakes are reported before the run. `recorded`: the poses if there
  /// is no file. Throws Failure.
  Truth(const Arguments& arguments, const CaptureFolder& folder, std::vector<StampedPose> recorded);

  void add(const OdometryEstimate& estimate);

  /// Returns the true poses; empty if there are none.
  [[nodiscard]] std::span<const StampedPose> trajectory() const { return trajectory_; }

  /// Compares; slow with a map. `steps`: those of the clock that stamped the true poses. May be called once: it
  /// converts the true poses to steady time, and frees the covariances, 10 MB per hour of driving.
  /// True poses of another time are a problem if the user named them, and a warning if they lie in the folder.
  [[nodiscard]] Accuracy compare(std::span<const SurfacePoint> map, const std::vector<ClockStep>& steps,
                                 bool show_progress);

 private:
  [[nodiscard]] std::optional<std::string> convert(const std::vector<ClockStep>& steps);
  [[nodiscard]] std::string why_nothing_in_common() const;

  bool is_named_;                                    ///< the user named the file of the true poses
  std::filesystem::path trajectory_file_, map_file_; ///< empty: none
  std::vector<StampedPose> trajectory_;
  std::optional<PointCloudFile> map_;
  std::vector<StampedPose> estimates_; ///< only with a true trajectory
  std::vector<Matrix6> covariances_;   ///< of the estimates
};

} // namespace locus::tools
