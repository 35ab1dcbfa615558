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
/// The words of odometry.csv and the status.
constexpr auto names_of(TrackingState) {
  return std::to_array<std::string_view>({"tracking", "degenerate", "dead_reckoning", "standstill"});
}

/// Where the first pose of a run is from: level at the origin, as begin_at() was told, as an odometry says that bridges
/// the time since the run before, or found in the map of that.
enum class Beginning : std::uint8_t { origin, told, odometry, map };
constexpr auto names_of(Beginning) { return std::to_array<std::string_view>({"origin", "told", "odometry", "map"}); }

/// Where the start of a registration came from.
struct PriorSource : SourceChoice {
  NoSourcePrior otherwise = NoSourcePrior::identity; ///< in place of what no source said
};

/// How a motion source compares with all the rest.
struct SourceReport {
  Innovation innovation;                ///< of the last sweep that both told of; its variances are zero before that
  double test_ratio = 0;                ///< of it; zero where nothing could be compared
  Stamp last_used;                      ///< end of the last sweep whose prior came from it; Stamp{}: never
  std::optional<Pose> T_source_base;    ///< where an odometry saw the base at the end of the sweep, in its own frame
  bool doubted = false;                 ///< it was not healthy then
  std::optional<LearnedSource> learned; ///< of it by the end of the sweep, by this run or one before
};

/// What one sweep says about the robot, with all that is needed to distrust it.
struct OdometryEstimate {
  Stamp stamp;                                ///< end of the sweep
  Pose T_odom_base;                           ///< paper X_k
  Matrix6 pose_covariance = Matrix6::Zero();  ///< of x, y, z and turns about the odom axes; since the start
  Vector6 twist_base = Vector6::Zero();       ///< m/s and rad/s, base frame
  Matrix6 twist_covariance = Matrix6::Zero(); ///< base frame
  /// How well lidar sees x, y, z, roll, pitch and yaw of the base, from 0 (not at all) to 1: the share of the normals
  /// around that lies along an axis, for turns the square of their mean lever in metres; after what a motion along the
  /// other axes could be mistaken for is taken out.
  Vector6 observability = Vector6::Zero();
  TrackingState state = TrackingState::tracking;
  std::optional<Beginning> beginning; ///< of the run; nothing before its first sweep
  PriorSource prior;
  std::array<SourceReport, kMaxSources> sources{}; ///< by index
  Registration scan_to_scan;                       ///< paper equation 1; zero iterations where it did not run
  Registration scan_to_submap;                     ///< paper equation 2
  std::size_t points = 0;                          ///< that were registered
  bool failed = false;                             ///< the registration was refused: the pose is the prediction
  bool keyframe = false;                           ///< the map took this sweep
};

} // namespace locus
