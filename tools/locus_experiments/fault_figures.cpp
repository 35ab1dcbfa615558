// SPDX-License-Identifier: Apache-2.0
#include "locus_experiments/fault_figures.hpp"

#include <algorithm>
#include <vector>

#include "accuracy/pose_pairs.hpp"
#include "accuracy/trajectory_accuracy.hpp"
#include "locus_experiments/odometry_rows.hpp"

namespace locus::experiments {
namespace {

using nlohmann::ordered_json;

/// Measures the path in steps of a second, so that shaking does not add to it.
double driven_m(std::span<const StampedPose> truth) {
  constexpr Duration kStep = std::chrono::seconds{1};
  double sum_m = 0.0;
  const StampedPose* last = &truth.front();
  for (const StampedPose& pose : truth) {
    if (pose.stamp - last->stamp < kStep && &pose != &truth.back())
      continue;
    sum_m += (pose.T_source_base.translation - last->T_source_base.translation).norm();
    last = &pose;
  }
  return sum_m;
}

double share_flagged(std::span<const OdometryRow> rows) {
  const auto flagged = std::ranges::count_if(rows, &OdometryRow::flagged);
  return static_cast<double>(flagged) / std::max(1.0, static_cast<double>(rows.size()));
}

ordered_json growth(const std::vector<OdometryRow>& rows, std::span<const StampedPose> estimates) {
  constexpr double kBegun_m = 5;
  const auto way_m = [&](const StampedPose& pose) -> Eigen::Vector2d {
    return (pose.T_source_base.translation - estimates.front().T_source_base.translation).head<2>();
  };
  const auto away_m = [&](const StampedPose& pose) { return way_m(pose).norm(); };
  const auto begun = std::ranges::find_if(estimates, [&](const StampedPose& pose) { return away_m(pose) >= kBegun_m; });
  const auto farthest = std::ranges::max_element(estimates, {}, away_m);
  if (begun == estimates.end())
    return nullptr;
  const Eigen::Vector2d along = way_m(*farthest).normalized(), across = along.unitOrthogonal();
  const auto growth_along = [&](const Eigen::Vector2d& axis) {
    const auto variance_m2 = [&](const auto& pose) {
      return axis.dot(rows[static_cast<std::size_t>(pose - estimates.begin())].covariance_m2 * axis);
    };
    return variance_m2(farthest) / variance_m2(begun);
  };
  return {{"along", growth_along(along)}, {"across", growth_along(across)}};
}

} // namespace

double error_added_m(std::span<const StampedPose> estimates, std::span<const StampedPose> truth,
                     const Interval& interval) {
  const std::vector<PosePair> pairs = paired(estimates, truth);
  const Stamp from = truth.front().stamp + from_seconds(interval.from_s);
  const Stamp until = truth.front().stamp + from_seconds(interval.until_s);
  const auto last_until = [&](Stamp stamp) {
    return std::ranges::upper_bound(pairs, stamp, {}, &PosePair::stamp) - pairs.begin() - 1;
  };
  const auto first = last_until(from), last = last_until(until);
  if (first < 0)
    return 0.0;
  const PosePair &begin = pairs[static_cast<std::size_t>(first)], &end = pairs[static_cast<std::size_t>(last)];
  const Pose T_odom = begin.T_odom_base.inverse() * end.T_odom_base;
  const Pose T_truth = begin.T_truth_base.inverse() * end.T_truth_base;
  return (T_odom.translation - T_truth.translation).norm();
}

ordered_json fault_figures(const Interval& interval, const std::filesystem::path& run_folder,
                           const CaptureFolder& capture) {
  const auto [estimates, rows] = read_odometry(run_folder);
  const std::vector<StampedPose> truth = read_poses(capture.ground_truth);
  const Stamp from = truth.front().stamp + from_seconds(interval.from_s);
  const auto before = std::ranges::lower_bound(estimates, from, {}, &StampedPose::stamp) - estimates.begin();
  ordered_json figures{{"length_m", driven_m(truth)},
                       {"added_m", error_added_m(estimates, truth, interval)},
                       {"told", share_flagged(std::span{rows}.subspan(static_cast<std::size_t>(before)))},
                       {"growth", growth(rows, estimates)},
                       {"sources", ordered_json::object()}};
  for (const CaptureFolder::Source& source : capture.odometry) {
    const std::vector<StampedPose> poses = read_poses(source.files.front());
    const auto accuracy = trajectory_accuracy(poses, truth);
    figures["sources"][source.name] = {{"added_m", error_added_m(poses, truth, interval)},
                                       {"ape_mean_m", accuracy ? accuracy->ape_m.mean : 0.0}};
  }
  return figures;
}

} // namespace locus::experiments
