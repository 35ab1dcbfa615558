// SPDX-License-Identifier: Apache-2.0
#include "core/odometry/map_policy.hpp"

#include <chrono>

namespace locus {

namespace {

/// After so many refusals in a row the submap is behind us, and the map goes on from the prediction. Where wheels or
/// legs carry the estimate it waits, for so long since lidar last placed the robot: what is measured wrong must not get
/// into the map.
constexpr int kRefusalsToRestart = 10;
constexpr Duration kLately = std::chrono::seconds{5};

} // namespace

void MapPolicy::begin(Stamp stamp, const Pose& T_odom_base) {
  T_odom_keyframe_ = T_odom_base;
  last_placed_ = stamp;
  refused_in_a_row_ = 0;
  placed_ = 1;
}

bool MapPolicy::was_placed_lately(Stamp now) const { return std::chrono::abs(now - last_placed_) < kLately; }

MapPolicy::Verdict MapPolicy::judge(const Outcome& outcome) {
  if (outcome.placed) {
    refused_in_a_row_ = 0;
    ++placed_;
    last_placed_ = outcome.stamp;
  } else if (outcome.has_points) {
    ++refused_in_a_row_;
  }
  const Pose T_keyframe_base = T_odom_keyframe_.inverse() * outcome.T_odom_base;
  const bool moved = T_keyframe_base.translation.norm() > options_.keyframe_m ||
                     angle_rad(T_keyframe_base.rotation) > options_.keyframe_deg * kRadPerDeg;
  // As many sweeps contradict the map as ever fitted: it was begun wrong, and there is nothing in it to go on from.
  const bool in_doubt = !resumed_ && refused_in_a_row_ >= placed_;
  const bool carried = outcome.carried && was_placed_lately(outcome.stamp) && !in_doubt;
  const bool restarts = refused_in_a_row_ >= kRefusalsToRestart && !carried && outcome.has_points;
  if (!restarts && !(outcome.placed && moved && !outcome.misses_most))
    return Verdict::waits;
  T_odom_keyframe_ = outcome.T_odom_base;
  refused_in_a_row_ = 0;
  if (!restarts || !in_doubt)
    return Verdict::takes_in;
  placed_ = 1;
  return Verdict::begins_anew;
}

} // namespace locus
