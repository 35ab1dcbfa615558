// SPDX-License-Identifier: Apache-2.0
#include "locus_replay/truth.hpp"

#include <fmt/format.h>

#include "locus_replay/failure.hpp"

namespace locus::tools {

Truth::Truth(const Arguments& arguments, const CaptureFolder& folder)
    : trajectory_file_(arguments.ground_truth.empty() ? folder.ground_truth : arguments.ground_truth) {
  if (!trajectory_file_.empty())
    trajectory_ = value_or_fail(read_trajectory(trajectory_file_), ExitStatus::failed);
  const std::filesystem::path& map_file = arguments.map_truth.empty() ? folder.map_truth : arguments.map_truth;
  if (!map_file.empty())
    map_ = value_or_fail(PointCloudFile::open(map_file), ExitStatus::failed);
}

void Truth::take(const OdometryEstimate& estimate) {
  if (!trajectory_.empty())
    estimates_.push_back({estimate.stamp, estimate.T_odom_base});
}

Accuracy Truth::compare(std::span<const SurfacePoint> map, bool show_progress) const {
  Accuracy accuracy;
  if (!trajectory_.empty()) {
    accuracy.trajectory = trajectory_accuracy(estimates_, trajectory_);
    if (!accuracy.trajectory)
      accuracy.problems.push_back(why_nothing_in_common());
  }
  if (map_) {
    ProgressBar progress(show_progress);
    std::vector<Eigen::Vector3f> positions_m;
    for (const SurfacePoint& point : map)
      positions_m.push_back(point.position_m);
    const Pose T_truth_odom = accuracy.trajectory ? accuracy.trajectory->T_truth_odom : Pose{};
    const auto found = map_accuracy(positions_m, *map_, T_truth_odom, [&](double done) { progress.show(done); });
    if (found)
      accuracy.map = *found;
    else
      accuracy.problems.push_back(found.error());
  }
  return accuracy;
}

std::string Truth::why_nothing_in_common() const {
  const auto span = [](const std::vector<StampedPose>& poses) {
    return poses.empty() ? std::string{"none"}
                         : fmt::format("{:.3f} to {:.3f} s", to_seconds(poses.front().stamp.time_since_epoch()),
                                       to_seconds(poses.back().stamp.time_since_epoch()));
  };
  return fmt::format("{}: its poses ({}) and the sweeps ({}) have no time in common; give the truth of this recording, "
                     "by the same clock",
                     trajectory_file_.string(), span(trajectory_), span(estimates_));
}

} // namespace locus::tools
