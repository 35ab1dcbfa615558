// SPDX-License-Identifier: Apache-2.0
#include "core/odometry/odometry.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "core/odometry/relocation.hpp"
#include "core/sources/motion_sources.hpp"

namespace locus {

namespace {

/// Standard deviation of the prior position above which correspondences are searched in all voxels around a point.
constexpr double kWide_m = 0.3;

/// Capacity for the 16 000 voxels of a large sweep that still fits the L2 cache.
constexpr std::size_t kLastScanBytes = 2'500'000;

/// Deviation of a gyro's estimated lateness from the applied one above which it is updated, and its largest value.
constexpr double kPlainlyLate_sigma = 3.0, kPlainlyLate_s = 0.001, kMostLate_s = 0.25;

/// Elapsed time, in sweep lengths, above which sweeps were dropped in between.
constexpr double kDropped = 1.5;

/// Share of eq. 15 in docs/estimator.md. Returns the fraction of the future registration target contributed by this
/// keyframe. If a share s of its surfaces is new, 2/s - 1 sweeps are visible at a time, and a step in the mean over
/// that many shifts it by 2s/(1 + s) of the step in the long run. Along axes that no surface constrains the fraction is
/// 1, since older surfaces do not hold the target.
Matrix6 share_of_map(double fresh, const Matrix6& observability) {
  const Matrix6 all = Matrix6::Identity();
  const Matrix6 constrained = observability / ObservedAxes::kWeakBelow;
  const Matrix6 unconstrained = (constrained * constrained + all).inverse();
  const double share = 2.0 * fresh / (1.0 + fresh);
  return share * all + (1.0 - share) * unconstrained;
}

/// Tells whether voxels without a plane serve as correspondences of the next sweep, too; empty: if planes are few. A
/// share of points with a plane about that of the registration's own decision would reverse it in every other sweep.
std::optional<bool> shapeless_after(const Registration& fit) {
  constexpr double kManyPlanes = 0.5;
  if (fit.shapeless && static_cast<double>(fit.planes) <= kManyPlanes * static_cast<double>(fit.points))
    return true;
  return std::nullopt;
}

} // namespace

Odometry::Odometry(const OdometryOptions& options, const std::vector<MotionSourceOptions>& sources, StageClock* clock)
    : options_(options), sources_(sources), clock_(clock), gicp_(options.threads, options.isa),
      flat_ground_(options.flat_ground), map_(options.map.max_bytes, options.isa),
      last_scan_map_(kLastScanBytes, options.isa, true), map_policy_(options.map), filter_(sources, options.motion) {
  std::vector<MotionSourceOptions> observed = sources;
  for (std::size_t i = 0; i < sources.size(); ++i) {
    feedback_.late[i] = MotionTrack::applied_lateness(1e-3 * sources[i].late_ms);
    if (sources[i].calibration == Calibration::report)
      observed[i].calibration = Calibration::automatic;
  }
  if (observed != sources)
    observer_.emplace(observed, options.motion);
}

void Odometry::begin_at(const ResumeState& last, std::span<const SurfacePoint> map_odom) {
  start_ = last;
  continues_motion_ = !last.was_at_rest();
  map_.insert(map_odom, Pose{});
}

void Odometry::recall(const LearnedSources& learned, double elapsed_s) {
  for (std::size_t i = 0; i < sources_.size(); ++i)
    if (learned[i]) {
      filter_.recall(SourceId{i}, *learned[i], elapsed_s);
      if (observer_)
        observer_->recall(SourceId{i}, *learned[i], elapsed_s);
      learned_since_[i] = learned[i]->since;
      recalled_.set(i);
    }
}

OdometryEstimate Odometry::process(const Sweep& sweep, const Gicp::StopRequested& stop) {
  prepare_next();
  if (!beginning_)
    return begin(sweep);
  if (first_)
    find_start(sweep, stop);
  const Pose T_odom_last = filter_.pose();
  Hypothesis best = choose(sweep, stop);
  filter_ = best.filter;
  OdometryEstimate estimate;
  estimate.scan_to_scan = best.scan_to_scan;
  estimate.scan_to_submap = best.fit;
  shapeless_ = shapeless_after(best.fit);
  static_cast<SourceChoice&>(estimate.prior) = best.choice;
  estimate.prior.otherwise = options_.no_source_prior;
  estimate.failed = !best.accepted;
  if (estimate.failed) {
    estimate.state = TrackingState::dead_reckoning;
  } else if (best.rests) {
    estimate.state = TrackingState::standstill;
  } else {
    filter_.update(best.fit.T_target_source, best.fit.twist_base, best.fit.information);
  }
  if (!estimate.failed) {
    filter_.learn();
    lidar_health_.learn(best.fit, steps_.elapsed_s(sweep));
  }
  if (observer_)
    observe(sweep, best);
  stands_ = best.rests;
  correct(sweep, filter_.twist_base(), best.rests ? kAllSources : best.without);
  if (flat_ground_.holds())
    flatten(T_odom_last, estimate.failed ? Matrix12::Zero().eval() : best.fit.information);
  finish(sweep, estimate);
  return estimate;
}

/// Sets the poses of all filters to flat ground: a rival that takes over is on the same ground. `information`: of the
/// sweep, about the pose and twist of the selected filter.
void Odometry::flatten(const Pose& T_odom_last, const Matrix12& information) {
  const auto flatten = [&](MotionFilter& filter, const Matrix12& of_points) {
    filter.set_pose(flat_ground_.flatten(T_odom_last, filter.pose(), of_points.topLeftCorner<6, 6>()));
  };
  flatten(filter_, information);
  for (std::optional<Rival>& rival : rivals_)
    if (rival)
      flatten(rival->hypothesis.filter, rival->hypothesis.fit.information);
}

void Odometry::prepare_next() {
  if (scan_is_next_target_) {
    const StageScope scope(clock_, Stage::scan_to_scan);
    last_scan_map_.clear();
    last_scan_map_.insert(scan_, filter_.pose());
    scan_is_next_target_ = false;
    has_last_scan_ = true;
  }
  if (!keyframe_observability_)
    return;
  const StageScope scope(clock_, Stage::map);
  const double fresh = map_.insert(free_space_.leave_out_moving(scan_, filter_.pose()), filter_.pose());
  const Matrix6 share = share_of_map(fresh, *keyframe_observability_);
  filter_.transfer_error_to_map(share);
  for (std::optional<Rival>& rival : rivals_)
    if (rival)
      rival->hypothesis.filter.transfer_error_to_map(share);
  if (observer_)
    observer_->transfer_error_to_map(share);
  keyframe_observability_.reset();
}

/// Chooses among the usable sources, except those in `without`.
SourceChoice Odometry::choose_among(const Sweep& sweep, std::bitset<kMaxSources> without) const {
  return choose_sources([this](SourceId source) { return sources_[index_of(source)].kind; }, sources_.size(),
                        options_.fusion,
                        [&](SourceId source) { return !without[index_of(source)] && steps_.is_usable(sweep, source); });
}

/// Returns the twist during the sweep minus the mean since the last processed one, as far as sources measure it. Zero
/// unless sweeps were dropped in between.
Vector6 Odometry::twist_offset_after_drops(const Sweep& sweep) const {
  Vector6 difference = Vector6::Zero();
  if (steps_.elapsed_s(sweep) < kDropped * to_seconds(sweep.end - sweep.start))
    return difference;
  const Vector6 during_sweep = corrected_twist(sweep);
  const auto [rotation, translation] = choose_among(sweep, {});
  if (translation)
    difference.head<3>() = (during_sweep - steps_.twist_base(sweep, *translation)->mean).head<3>();
  if (rotation)
    difference.tail<3>() = (during_sweep - steps_.twist_base(sweep, *rotation)->mean).tail<3>();
  return difference;
}

/// Returns the hypothesis after the update with the sources, before registration. `last`: filter after the last sweep.
Odometry::Hypothesis Odometry::assume(const Sweep& sweep, const Assumption& assumption,
                                      const MotionFilter& last) const {
  Hypothesis hypothesis{assumption, choose_among(sweep, assumption.without), false, last, {}, {}};
  apply_sources(hypothesis.filter, sweep, hypothesis);
  return hypothesis;
}

/// Predicts the filter for a sweep and updates it with the sources of a hypothesis, all but lidar.
void Odometry::apply_sources(MotionFilter& filter, const Sweep& sweep, const Hypothesis& hypothesis) const {
  const auto& [rotation, translation] = hypothesis.choice;
  const bool free = hypothesis.without.all();
  const std::optional<SpecificForce> force = force_of(sweep, hypothesis.without);
  std::optional<Eigen::Vector3d> sensed_rate;
  if (force)
    if (const auto sensed = steps_.twist_base(sweep, force->source))
      sensed_rate = sensed->mean.tail<3>();
  filter.predict(std::max(steps_.elapsed_s(sweep), 1e-6), to_seconds(sweep.end - sweep.start), force,
                 {.translation = free || translation, .rotation = free || rotation}, sensed_rate);
  if (rotation)
    filter.measure(*rotation, *steps_.twist_base(sweep, *rotation),
                   {.translation = translation == rotation, .rotation = true, .slips = hypothesis.slips});
  if (translation && translation != rotation)
    filter.measure(*translation, *steps_.twist_base(sweep, *translation),
                   {.translation = true, .rotation = false, .slips = hypothesis.slips});
  if (hypothesis.rests)
    filter.rest();
  if (hypothesis.turn_radps != 0.0)
    filter.expect_turn(hypothesis.turn_radps, kTurnSigma_radps);
  if (!rotation && !translation && options_.no_source_prior == NoSourcePrior::identity)
    filter.expect_rest();
  filter.move();
}

/// Updates the observer, which estimates calibrations that are only reported. The posterior `fit` includes the prior of
/// the best hypothesis's filter; that prior is exchanged for the observer's.
void Odometry::observe(const Sweep& sweep, const Hypothesis& best) {
  apply_sources(*observer_, sweep, best);
  if (best.accepted && !best.rests) {
    const Registration& fit = best.fit;
    const auto expected = [&](const MotionFilter& filter) {
      Vector12 off_fit;
      off_fit << difference(filter.pose(), fit.T_target_source), filter.twist_base() - fit.twist_base;
      return Vector12{filter.covariance().inverse() * off_fit};
    };
    const Matrix12 known = observer_->covariance().inverse() + fit.information;
    const Vector12 off_fit = known.ldlt().solve(expected(*observer_) - expected(best.filter));
    observer_->update({(so3_exp(off_fit.segment<3>(3)) * fit.T_target_source.rotation).normalized(),
                       fit.T_target_source.translation + off_fit.head<3>()},
                      fit.twist_base + off_fit.tail<6>(), fit.information);
  }
  if (best.accepted)
    observer_->learn();
}

/// Registers the sweep with the last one, starting from the hypothesis. The result is only the starting pose for the
/// submap, not a measurement, because the submap contains the last sweep, too.
void Odometry::match_last(const Sweep& sweep, const MotionBelief& belief, Hypothesis& hypothesis,
                          const Gicp::StopRequested& stop) {
  const StageScope scope(clock_, Stage::scan_to_scan);
  const Registration found = gicp_.align(aged_.sort(sweep, scan_, belief.twist_base), last_scan_map_,
                                         belief.T_target_source, belief, options_.scan_to_scan, false, stop);
  if (found.converged)
    hypothesis.fit.T_target_source = found.T_target_source;
  hypothesis.scan_to_scan = found;
  hypothesis.scan_to_scan.T_target_source = filter_.pose().inverse() * found.T_target_source;
}

/// Returns the points of the sweep by age. The first registration of a sweep decides for all whether voxels without a
/// plane serve: hypotheses compare only if they fit the points to the same surfaces.
ElasticScan Odometry::aged_scan(const Sweep& sweep, const Vector6& twist_base) {
  ElasticScan scan = aged_.sort(sweep, scan_, twist_base);
  scan.shapeless = shapeless_;
  return scan;
}

/// Registers the sweep with the submap, starting from the hypothesis. A registration that does not converge goes on
/// once more from where it stopped, with the points de-skewed for the motion found so far.
void Odometry::register_with(const Sweep& sweep, Hypothesis& hypothesis, const Gicp::StopRequested& stop) {
  MotionBelief belief = hypothesis.filter.belief();
  RegistrationOptions options = options_.scan_to_submap;
  if (hypothesis.rests) {
    belief.T_target_source = filter_.pose();
    belief.twist_base.setZero();
    belief.information = 1e12 * Matrix12::Identity();
    options.max_iterations = 4;
  }
  hypothesis.fit = {};
  hypothesis.fit.T_target_source = belief.T_target_source;
  hypothesis.fit.twist_base = belief.twist_base;
  const std::bitset<kMaxSources> without = hypothesis.rests ? kAllSources : hypothesis.without;
  correct(sweep, belief.twist_base, without);
  if (sweep.points.size() < kMinPoints)
    return;
  if (has_last_scan_ && !hypothesis.rests)
    match_last(sweep, belief, hypothesis, stop);
  const StageScope scope(clock_, Stage::scan_to_submap);
  const bool wide =
      hypothesis.turn_radps != 0.0 ||
      (!hypothesis.rests && hypothesis.filter.covariance().diagonal().head<3>().maxCoeff() > kWide_m * kWide_m);
  const Pose T_start = hypothesis.fit.T_target_source;
  hypothesis.fit = gicp_.align(aged_scan(sweep, belief.twist_base), map_, T_start, belief, options, wide, stop);
  if (!shapeless_)
    shapeless_ = hypothesis.fit.shapeless;
  if (hypothesis.fit.converged || stop())
    return;
  const int before = hypothesis.fit.iterations;
  correct(sweep, hypothesis.fit.twist_base, without);
  hypothesis.fit = gicp_.align(aged_scan(sweep, hypothesis.fit.twist_base), map_, hypothesis.fit.T_target_source,
                               belief, options, false, stop);
  hypothesis.fit.iterations += before;
}

/// Returns the specific force of a sweep, or none if its source is excluded.
std::optional<SpecificForce> Odometry::force_of(const Sweep& sweep, std::bitset<kMaxSources> without) {
  const std::optional<SpecificForce>& force = sweep.motion.specific_force;
  return force && !without[index_of(force->source)] ? force : std::nullopt;
}

/// De-skews the points for a base that moved with mean twist `twist_base` since the last sweep. If sources are
/// excluded, their motion within the sweep is removed, unless they repeat their pose: then there is none.
void Odometry::correct(const Sweep& sweep, const Vector6& twist_base, std::bitset<kMaxSources> without) {
  without &= ~repeating_sources(sweep);
  move_points(sweep, without.any() ? SweepCorrection::constant(sweep, twist_base)
                                   : SweepCorrection::all(sweep, twist_base + twist_offset_after_drops(sweep)));
}

void Odometry::move_points(const Sweep& sweep, const SweepCorrection& correction) {
  correction_ = correction;
  correction_.apply(sweep.points, scan_);
}

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

/// Stores where the robot was when each source last changed its pose. `returns`: lidar is registered again after dead
/// reckoning, which moves the estimate, not the robot.
void Odometry::store_changes(const Sweep& sweep, bool returns) {
  constexpr double kRounding = 1e-7; ///< m and rad
  for (std::size_t i = 0; i < sources_.size(); ++i) {
    const SourcePose& now = sweep.motion.sources[i];
    std::optional<LastChange>& last = last_changes_[i];
    if (!now.known)
      continue;
    const bool changed =
        last && se3_log(last->T_source_base.inverse() * now.T_source_base).cwiseAbs().maxCoeff() > kRounding;
    if (!last || changed || returns)
      last = {now.T_source_base, filter_.pose().translation, filter_.covariance().topLeftCorner<3, 3>()};
  }
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

/// Completes the estimate, decides on the keyframe, and stores the sweep as the last one.
void Odometry::finish(const Sweep& sweep, OdometryEstimate& estimate) {
  estimate.stamp = sweep.end;
  estimate.beginning = beginning_;
  estimate.points = sweep.registered;
  estimate.T_odom_base = filter_.pose();
  feedback_ = {.from = steps_.last(),
               .to = sweep.end,
               .opinions = {},
               .twist_base = Vector6::Zero(),
               .observes = {},
               .late = feedback_.late};
  if (!estimate.failed)
    report(sweep, estimate);
  for (const auto& source : {estimate.prior.rotation, estimate.prior.translation})
    if (source)
      source_reports_[index_of(*source)].last_used = sweep.end;
  const bool returns = !registered_ && !estimate.failed;
  registered_ = !estimate.failed;
  scan_is_next_target_ = registered_ && options_.scan_to_scan_mode == ScanToScanMode::always;
  tilt_keeper_.observe(estimate.T_odom_base.rotation, gravity_.up_base());
  const MapPolicy::Verdict verdict =
      map_policy_.judge({.stamp = sweep.end,
                         .T_odom_base = estimate.T_odom_base,
                         .accepted = !estimate.failed,
                         .has_points = scan_.size() >= kMinPoints,
                         .lacks_correspondences = lidar_health_.lacks_correspondences(estimate.scan_to_submap),
                         .carried = estimate.prior.translation.has_value(),
                         .turn_measured = estimate.prior.rotation.has_value(),
                         .overlap = estimate.scan_to_submap.overlap()});
  if (verdict == MapPolicy::Verdict::restart)
    map_.clear();
  if (verdict != MapPolicy::Verdict::wait) {
    if (estimate.failed)
      free_space_.clear();
    free_space_.expect(sweep);
    estimate.keyframe = true;
    keyframe_observability_ = estimate.scan_to_submap.observability;
    filter_.set_pose({(so3_exp(tilt_keeper_.pop_correction_rad()) * estimate.T_odom_base.rotation).normalized(),
                      estimate.T_odom_base.translation});
    estimate.T_odom_base = filter_.pose();
  }
  estimate.twist_base = filter_.twist_base();
  estimate.twist_covariance = filter_.covariance().bottomRightCorner<6, 6>();
  estimate.pose_covariance = filter_.pose_covariance_since_start();
  if (observer_)
    observer_->set_pose(filter_.pose());
  report_sources(sweep, estimate);
  store_changes(sweep, returns);
  steps_.store(sweep);
}

} // namespace locus
