// SPDX-License-Identifier: Apache-2.0
#include "daemon/learned_figures.hpp"

#include <cmath>

#include "core/sources/motion_track.hpp"

namespace locus::daemon {

bool is_observed(const Learned& figure, const Learned& configured) {
  return figure.sigma < kObservedRatio * configured.sigma;
}

bool is_known_better(const Learned& figure, const Learned& configured) {
  return std::abs(figure.mean - configured.mean) > kMinDeviation_sigma * figure.sigma &&
         is_observed(figure, configured);
}

bool is_too_late(const MotionSourceOptions& source, const LearnedSource& learned) {
  constexpr double kMaxResidualLateness_s = 1e-3; // largest delay left after the compensation by MotionTrack
  const double late_s = learned.lateness_s().mean;
  return source.kind == SourceKind::imu &&
         late_s - to_seconds(MotionTrack::applied_lateness(late_s)) > kMaxResidualLateness_s;
}

Learned configured_lateness_s(const MotionSourceOptions& odometry) {
  return {1e-3 * odometry.late_ms, OdometryFindings::kPriorLate_s};
}

Learned lateness_s(const MotionSourceOptions& odometry, const std::optional<OdometryFindings>& compared) {
  const Learned configured = configured_lateness_s(odometry);
  return compared && is_observed(compared->late_s, configured) ? compared->late_s : configured;
}

} // namespace locus::daemon
