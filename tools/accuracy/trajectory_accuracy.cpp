// SPDX-License-Identifier: Apache-2.0
#include "accuracy/trajectory_accuracy.hpp"

#include <Eigen/Geometry>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <numeric>

namespace locus {
namespace {

struct PosePair {
  Stamp stamp;
  Pose T_odom_base;
  Pose T_truth_base;
};

/// Beyond this, an interval of the truth is a hole: twice the usual one, but a second is always bridged.
Duration longest_interval(std::span<const StampedPose> truth) {
  std::vector<Duration> intervals;
  for (std::size_t i = 1; i < truth.size(); ++i)
    intervals.push_back(truth[i].stamp - truth[i - 1].stamp);
  if (intervals.empty())
    return {};
  const auto median = intervals.begin() + static_cast<std::ptrdiff_t>(intervals.size() / 2);
  std::ranges::nth_element(intervals, median);
  return std::max<Duration>(std::chrono::seconds{1}, 2 * *median);
}

std::optional<Pose> pose_at(std::span<const StampedPose> truth, Stamp stamp, Duration longest) {
  const auto after = std::ranges::lower_bound(truth, stamp, {}, &StampedPose::stamp);
  if (after == truth.end() || (after == truth.begin() && after->stamp > stamp))
    return std::nullopt;
  if (after->stamp == stamp)
    return after->T_source_base;
  const auto before = std::prev(after);
  if (after->stamp - before->stamp > longest)
    return std::nullopt;
  return interpolate(before->T_source_base, after->T_source_base,
                     to_seconds(stamp - before->stamp) / to_seconds(after->stamp - before->stamp));
}

std::vector<PosePair> paired(std::span<const StampedPose> estimates, std::span<const StampedPose> truth) {
  const Duration longest = longest_interval(truth);
  std::vector<PosePair> pairs;
  for (const StampedPose& estimate : estimates) {
    if (const std::optional<Pose> T_truth_base = pose_at(truth, estimate.stamp, longest))
      pairs.push_back({estimate.stamp, estimate.T_source_base, *T_truth_base});
  }
  return pairs;
}

/// Points that move with the attitude of the base, and are centred on it.
const std::array<Eigen::Vector3d, 4> kAroundBase{{{1, 1, 1}, {1, -1, -1}, {-1, 1, -1}, {-1, -1, 1}}};

/// Least squares between points that are fixed to the base.
Pose aligned(std::span<const PosePair> pairs, std::span<const Eigen::Vector3d> points_base) {
  Eigen::Matrix3Xd odom(3, pairs.size() * points_base.size()), truth(3, pairs.size() * points_base.size());
  Eigen::Index column = 0;
  for (const PosePair& pair : pairs) {
    for (const Eigen::Vector3d& point : points_base) {
      odom.col(column) = pair.T_odom_base * point;
      truth.col(column++) = pair.T_truth_base * point;
    }
  }
  const Eigen::Matrix4d T = Eigen::umeyama(odom, truth, false);
  return {Eigen::Quaterniond{Eigen::Matrix3d{T.topLeftCorner<3, 3>()}}, T.topRightCorner<3, 1>()};
}

struct StretchError {
  double percent, deg;
};

/// The mean over every stretch that begins at a pose and ends at the first one `length_m` of path farther on.
std::optional<StretchError> relative_error(std::span<const PosePair> pairs, double length_m) {
  std::vector<double> path_m{0.0};
  for (std::size_t i = 1; i < pairs.size(); ++i)
    path_m.push_back(path_m.back() +
                     (pairs[i].T_truth_base.translation - pairs[i - 1].T_truth_base.translation).norm());
  StretchError sum{0, 0};
  std::size_t begin = 0;
  for (std::size_t end = 1; end < pairs.size(); ++end) {
    for (; path_m[end] - path_m[begin] >= length_m; ++begin) {
      const Pose T_truth = pairs[begin].T_truth_base.inverse() * pairs[end].T_truth_base;
      const Pose error = T_truth.inverse() * (pairs[begin].T_odom_base.inverse() * pairs[end].T_odom_base);
      sum.percent += 100.0 * error.translation.norm() / (path_m[end] - path_m[begin]);
      sum.deg += angle_rad(error.rotation) * 180.0 / std::numbers::pi;
    }
  }
  if (begin == 0)
    return std::nullopt;
  return StretchError{sum.percent / static_cast<double>(begin), sum.deg / static_cast<double>(begin)};
}

double end_drift_m(const PosePair& first, const PosePair& last) {
  const Pose T_truth_odom = first.T_truth_base * first.T_odom_base.inverse();
  return (T_truth_odom * last.T_odom_base.translation - last.T_truth_base.translation).norm();
}

} // namespace

ErrorStatistics statistics_of(std::span<const double> errors) {
  if (errors.empty())
    return {};
  const auto count = static_cast<double>(errors.size());
  const double mean = std::accumulate(errors.begin(), errors.end(), 0.0) / count;
  double squares = 0, squares_about_mean = 0;
  for (const double error : errors) {
    squares += error * error;
    squares_about_mean += (error - mean) * (error - mean);
  }
  return {std::ranges::max(errors), mean, std::sqrt(squares_about_mean / count), std::sqrt(squares / count)};
}

std::optional<TrajectoryAccuracy> trajectory_accuracy(std::span<const StampedPose> estimates,
                                                      std::span<const StampedPose> truth) {
  const std::vector<PosePair> pairs = paired(estimates, truth);
  if (pairs.empty())
    return std::nullopt;
  TrajectoryAccuracy accuracy;
  const Pose T_by_positions = aligned(pairs, std::array{Eigen::Vector3d{0, 0, 0}});
  for (const PosePair& pair : pairs) {
    accuracy.stamps.push_back(pair.stamp);
    accuracy.position_error_m.push_back(
        (T_by_positions * pair.T_odom_base.translation - pair.T_truth_base.translation).norm());
  }
  accuracy.ape_m = statistics_of(accuracy.position_error_m);
  if (const std::optional<StretchError> error = relative_error(pairs, 10.0)) {
    accuracy.rpe_10m_percent = error->percent;
    accuracy.rpe_10m_deg = error->deg;
  }
  accuracy.end_drift_m = end_drift_m(pairs.front(), pairs.back());
  accuracy.T_truth_odom = aligned(pairs, kAroundBase);
  return accuracy;
}

} // namespace locus
