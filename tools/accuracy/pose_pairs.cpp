// SPDX-License-Identifier: Apache-2.0
#include "accuracy/pose_pairs.hpp"

#include <algorithm>
#include <iterator>
#include <optional>

namespace locus {

namespace {

/// Longest interval of the truth that is interpolated: twice the usual one, at least a second.
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

} // namespace

std::vector<PosePair> paired(std::span<const StampedPose> estimates, std::span<const StampedPose> truth) {
  const Duration longest = longest_interval(truth);
  std::vector<PosePair> pairs;
  for (std::size_t i = 0; i < estimates.size(); ++i) {
    if (const std::optional<Pose> T_truth_base = pose_at(truth, estimates[i].stamp, longest))
      pairs.push_back({i, estimates[i].stamp, estimates[i].T_source_base, *T_truth_base});
  }
  return pairs;
}

std::vector<Stretch> stretches_of(std::span<const PosePair> pairs, double length_m) {
  std::vector<double> path_m{0.0};
  for (std::size_t i = 1; i < pairs.size(); ++i)
    path_m.push_back(path_m.back() +
                     (pairs[i].T_truth_base.translation - pairs[i - 1].T_truth_base.translation).norm());
  std::vector<Stretch> stretches;
  std::size_t begin = 0;
  for (std::size_t end = 1; end < pairs.size(); ++end) {
    for (; path_m[end] - path_m[begin] >= length_m; ++begin)
      stretches.push_back({begin, end, path_m[end] - path_m[begin]});
  }
  return stretches;
}

} // namespace locus
