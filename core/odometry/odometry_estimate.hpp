// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string_view>

#include "core/base/names.hpp"
#include "core/base/options.hpp"
#include "core/base/pose.hpp"
#include "core/base/stamp.hpp"
#include "core/map/registration.hpp"
#include "core/odometry/motion_filter.hpp"
#include "core/sources/registration_feedback.hpp"
#include "core/sources/sensed_motion.hpp"

namespace locus {

enum class TrackingState : std::uint8_t { tracking, degenerate, dead_reckoning, standstill };
/// Words of odometry.csv and of the status.
constexpr auto names_of(TrackingState) {
  return std::to_array<std::string_view>({"tracking", "degenerate", "dead_reckoning", "standstill"});
}

/// Origin of the first pose of a run: level at the origin, passed to begin_at(), from an odometry that bridges the time
/// since the run before, or relocalised in the map of that run.
enum class Beginning : std::uint8_t { origin, told, odometry, map };
constexpr auto names_of(Beginning) { return std::to_array<std::string_view>({"origin", "told", "odometry", "map"}); }

/// Sources of the prior of a registration.
struct PriorSource : SourceChoice {
  NoSourcePrior otherwise = NoSourcePrior::identity; ///< for the motion that no source measured
};

/// Comparison of a motion source with all other information.
struct SourceReport {
  Innovation innovation;                ///< of the last sweep that both measured; before that its variances are zero
  double test_ratio = 0;                ///< of the innovation; zero without a comparison
  Stamp last_used;                      ///< end of the last sweep whose prior it provided; Stamp{}: never
  std::optional<Pose> T_source_base;    ///< base at the end of the sweep from an odometry, in its own frame
  bool doubted = false;                 ///< not healthy at that time
  std::optional<LearnedSource> learned; ///< calibration and noise at its end, from this run or an earlier one
};

/// Result of one sweep, with the figures needed to judge its reliability.
struct OdometryEstimate {
  Stamp stamp;                                ///< end of the sweep
  Pose T_odom_base;                           ///< paper X_k
  Matrix6 pose_covariance = Matrix6::Zero();  ///< of x, y, z and rotations about the odom axes; since the start
  Vector6 twist_base = Vector6::Zero();       ///< m/s and rad/s, base frame
  Matrix6 twist_covariance = Matrix6::Zero(); ///< base frame
  /// Observability by lidar of x, y, z, roll, pitch and yaw of the base, from 0 (none) to 1: the share of the
  /// surrounding normals along an axis, for rotations the square of their mean lever in metres; without the part that a
  /// motion along the other axes could explain.
  Vector6 observability = Vector6::Zero();
  TrackingState state = TrackingState::tracking;
  std::optional<Beginning> beginning; ///< of the run; nothing before its first sweep
  PriorSource prior;
  std::array<SourceReport, kMaxSources> sources{}; ///< by index
  Registration scan_to_scan;                       ///< paper equation 1; zero iterations where it did not run
  Registration scan_to_submap;                     ///< paper equation 2
  std::size_t points = 0;                          ///< registered
  bool failed = false;                             ///< the registration was rejected: the pose is the prediction
  bool keyframe = false;                           ///< the sweep was inserted into the map
};

} // namespace locus
