// SPDX-License-Identifier: Apache-2.0
#include "core/odometry/map_policy.hpp"

#include <algorithm>
#include <chrono>

namespace locus {

namespace {

/// Consecutive rejections after which the submap is out of sight and mapping resumes from the prediction. While wheels
/// or legs carry the estimate, mapping waits until kLately after the last accepted registration, to keep errors of a
/// wrong measurement out of the map.
constexpr int kRefusalsToRestart = 10;
constexpr Duration kLately = std::chrono::seconds{5};

/// Share of the best overlap since the last keyframe below which the next one is due, if the robot has also moved this
/// far: a narrow view turns to unmapped space long before the robot has driven a metre.
constexpr double kOverlapLeft = 0.85;
constexpr double kOverlapMoved_m = 0.1, kOverlapMoved_deg = 5.0;

} // namespace

void MapPolicy::begin(Stamp stamp, const Pose& T_odom_base) {
  T_odom_keyframe_ = T_odom_base;
  best_overlap_ = 0.0;
  last_accepted_ = stamp;
  refused_in_a_row_ = 0;
  accepted_ = 1;
}

bool MapPolicy::was_accepted_lately(Stamp now) const { return std::chrono::abs(now - last_accepted_) < kLately; }

/// Returns whether a keyframe is due: after a distance, a rotation, or a loss of overlap. The last requires a source
/// that measures rotation; without one, a wrong rotation would lose overlap and then enter the map.
bool MapPolicy::is_keyframe_due(const Outcome& outcome) const {
  const Pose T_keyframe_base = T_odom_keyframe_.inverse() * outcome.T_odom_base;
  const double moved_m = T_keyframe_base.translation.norm();
  const double turned_deg = angle_rad(T_keyframe_base.rotation) / kRadPerDeg;
  const bool loses_overlap = outcome.turn_measured && outcome.overlap < kOverlapLeft * best_overlap_ &&
                             (moved_m > kOverlapMoved_m || turned_deg > kOverlapMoved_deg);
  return moved_m > options_.keyframe_m || turned_deg > options_.keyframe_deg || loses_overlap;
}

MapPolicy::Verdict MapPolicy::judge(const Outcome& outcome) {
  if (outcome.accepted) {
    refused_in_a_row_ = 0;
    ++accepted_;
    last_accepted_ = outcome.stamp;
    best_overlap_ = std::max(best_overlap_, outcome.overlap);
  } else if (outcome.has_points) {
    ++refused_in_a_row_;
  }
  // At least as many sweeps contradict the map as ever fitted: it was started wrong and is of no use.
  const bool in_doubt = !resumed_ && refused_in_a_row_ >= accepted_;
  const bool carried = outcome.carried && was_accepted_lately(outcome.stamp) && !in_doubt;
  const bool restarts = refused_in_a_row_ >= kRefusalsToRestart && !carried && outcome.has_points;
  if (!restarts && !(outcome.accepted && is_keyframe_due(outcome) && !outcome.lacks_correspondences))
    return Verdict::wait;
  T_odom_keyframe_ = outcome.T_odom_base;
  best_overlap_ = 0.0;
  refused_in_a_row_ = 0;
  if (!restarts || !in_doubt)
    return Verdict::insert;
  accepted_ = 1;
  return Verdict::restart;
}

} // namespace locus
