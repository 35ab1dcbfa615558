// SPDX-License-Identifier: Apache-2.0
#include "locus_replay/truth.hpp"

#include <utility>

#include <fmt/format.h>

#include "locus_replay/failure.hpp"
#include "locus_replay/time_span_text.hpp"

namespace locus::tools {

Truth::Truth(const Arguments& arguments, const CaptureFolder& folder, std::vector<StampedPose> recorded)
    : is_named_(!arguments.ground_truth.empty()),
      trajectory_file_(arguments.ground_truth.empty() ? folder.ground_truth : arguments.ground_truth),
      map_file_(arguments.map_truth.empty() ? folder.map_truth : arguments.map_truth),
      trajectory_(std::move(recorded)) {
  if (!trajectory_file_.empty())
    trajectory_ = value_or_fail(read_trajectory(trajectory_file_, true), ExitStatus::failed);
  else
    trajectory_file_ = arguments.capture; // named in messages about the recorded poses
  if (!map_file_.empty())
    map_ = value_or_fail(PointCloudFile::open(map_file_), ExitStatus::failed);
}

void Truth::add(const OdometryEstimate& estimate) {
  if (trajectory_.empty())
    return;
  estimates_.push_back({estimate.stamp, estimate.T_odom_base});
  covariances_.push_back(estimate.pose_covariance);
}

/// Converts the poses to steady time. Returns an error if they go back without a step.
std::optional<std::string> Truth::convert(const std::vector<ClockStep>& steps) {
  ClockFollower clock;
  for (StampedPose& pose : trajectory_) {
    const Stamp recorded = pose.stamp;
    pose.stamp = clock.pass(recorded, steps);
    if (clock.own_steps() > 0)
      return fmt::format(
          "{}: its times jump at {:.3f} s, and those of the recording do not; sort the lines by time and "
          "keep one of each",
          trajectory_file_.string(), to_seconds(recorded.time_since_epoch()));
  }
  return std::nullopt;
}

Accuracy Truth::compare(std::span<const SurfacePoint> map, const std::vector<ClockStep>& steps, bool show_progress) {
  Accuracy accuracy;
  if (const auto problem = convert(steps)) {
    accuracy.problems.push_back(*problem);
  } else if (!trajectory_.empty()) {
    accuracy.trajectory = trajectory_accuracy(estimates_, trajectory_);
    accuracy.consistency = consistency(estimates_, std::exchange(covariances_, {}), trajectory_);
    if (!accuracy.trajectory)
      (is_named_ ? accuracy.problems : accuracy.warnings).push_back(why_nothing_in_common());
  }
  if (map_) {
    ProgressBar progress(show_progress);
    std::vector<Eigen::Vector3f> positions_m;
    for (const SurfacePoint& point : map)
      positions_m.push_back(point.position_m);
    const Pose T_truth_odom = accuracy.trajectory ? accuracy.trajectory->T_truth_odom : Pose{};
    const auto found = map_accuracy(positions_m, *map_, T_truth_odom, [&](double done) { progress.show(done); });
    if (!found)
      accuracy.problems.push_back(found.error());
    else
      accuracy.map = *found;
    if (found && found->compared == 0)
      accuracy.warnings.push_back(fmt::format("{}: none of the {} points of the map lies within 1 m of a true one; "
                                              "name the map of this place, in the frame of the true poses",
                                              map_file_.string(), found->outliers));
  }
  return accuracy;
}

std::string Truth::why_nothing_in_common() const {
  const auto span = [](const std::vector<StampedPose>& poses) {
    return text_of(poses.empty() ? std::nullopt : std::optional(TimeSpan{poses.front().stamp, poses.back().stamp}));
  };
  return fmt::format("{}: its poses ({}) and the sweeps ({}) have no time in common; name the truth of this recording, "
                     "by the same clock",
                     trajectory_file_.string(), span(trajectory_), span(estimates_));
}

} // namespace locus::tools
