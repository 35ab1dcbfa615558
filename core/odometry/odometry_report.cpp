// SPDX-License-Identifier: Apache-2.0
// Report of the odometry: observability, innovations, health and calibration of the sources.
#include <algorithm>
#include <cmath>

#include "core/odometry/odometry.hpp"
#include "core/sources/motion_track.hpp"

namespace locus {

namespace {

/// Deviation of a gyro's estimated lateness from the applied one above which it is updated, and its largest value.
constexpr double kPlainlyLate_sigma = 3.0, kPlainlyLate_s = 0.001, kMostLate_s = 0.25;

} // namespace

/// Reports observability and the innovations of the motion sources after an accepted registration.
void Odometry::report(const Sweep& sweep, OdometryEstimate& estimate) {
  const Matrix6 R = turn_both(estimate.T_odom_base.rotation);
  estimate.observability = observed_axes_.observe(R.transpose() * estimate.scan_to_submap.observability * R);
  if (!observed_axes_.all() && estimate.state == TrackingState::tracking)
    estimate.state = TrackingState::degenerate;
  if (!registered_)
    return; // a jump back to the submap is not motion of the robot
  for (std::size_t i = 0; i < sources_.size(); ++i)
    if (const auto twist_base = steps_.twist_base(sweep, SourceId{i})) {
      const Innovation innovation = filter_.innovation(SourceId{i}, *twist_base);
      source_reports_[i].innovation = innovation;
      source_reports_[i].test_ratio = test_ratio(innovation, steps_.elapsed_s(sweep)).value_or(0.0);
      feedback_.opinions[i] = opinion_on(innovation, steps_.elapsed_s(sweep));
    }
  feedback_.twist_base = observed_axes_.part_of(filter_.twist_base());
  feedback_.observes = observed_axes_.each();
}

/// Sets the lateness of a gyro that the ingest subtracts from its stamps. Follows the estimate only if it differs
/// clearly.
void Odometry::follow_lateness(const Learned& late_s, Duration& applied_lateness) {
  if (std::abs(late_s.mean - to_seconds(applied_lateness)) >
      std::max(kPlainlyLate_sigma * late_s.sigma, kPlainlyLate_s))
    applied_lateness = MotionTrack::applied_lateness(std::clamp(late_s.mean, -kMostLate_s, kMostLate_s));
}

/// Resets a source that was lost and returns with a new epoch, perhaps as another device. A sweep without a sample of
/// it is no loss: scale and bias are unchanged.
void Odometry::follow_epoch(SourceId source, const SourcePose& sensed) {
  std::optional<std::uint32_t>& epoch = epochs_[index_of(source)];
  if (!sensed.known || epoch == sensed.epoch)
    return;
  if (epoch && !recalled_[index_of(source)])
    reset_source(source);
  epoch = sensed.epoch;
}

void Odometry::reset_source(SourceId source) {
  last_changes_[index_of(source)].reset();
  filter_.reset_source(source);
  rivals_ = {};
  if (observer_)
    observer_->reset_source(source);
  if (sources_[index_of(source)].kind == SourceKind::odometry)
    learned_since_[index_of(source)] = Stamp{};
}

/// Reports pose, health and calibration of each source.
void Odometry::report_sources(const Sweep& sweep, OdometryEstimate& estimate) {
  for (std::size_t i = 0; i < sources_.size(); ++i) {
    const SourcePose& sensed = sweep.motion.sources[i];
    SourceReport& report = source_reports_[i];
    follow_epoch(SourceId{i}, sensed);
    if (sensed.usable)
      recalled_.reset(i);
    report.T_source_base =
        sensed.known && sources_[i].kind == SourceKind::odometry ? std::optional{sensed.T_source_base} : std::nullopt;
    report.doubted = !sensed.usable;
    report.learned.reset();
    if (!sensed.usable && !recalled_[i] && learned_since_[i] == Stamp{})
      continue; // not used yet
    if (sources_[i].kind == SourceKind::imu)
      follow_lateness(filter_.learned(SourceId{i}).lateness_s(), feedback_.late[i]);
    const bool only_reported = sources_[i].calibration == Calibration::report;
    report.learned = (only_reported ? *observer_ : filter_).learned(SourceId{i});
    if (learned_since_[i] == Stamp{})
      learned_since_[i] = sweep.end;
    report.learned->since = learned_since_[i];
  }
  estimate.sources = source_reports_;
}

} // namespace locus
