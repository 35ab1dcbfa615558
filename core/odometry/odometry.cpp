// SPDX-License-Identifier: Apache-2.0
#include "core/odometry/odometry.hpp"

#include <algorithm>
#include <array>
#include <utility>

#include "core/odometry/relocation.hpp"
#include "core/sources/motion_sources.hpp"

namespace locus {

namespace {

/// Capacity for the 16 000 voxels of a large sweep that still fits the L2 cache.
constexpr std::size_t kLastScanBytes = 2'500'000;

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
  const double fresh = map_.insert(free_space_.leave_out_contradicting(scan_, filter_.pose(), map_), filter_.pose());
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

/// Returns the specific force of a sweep, or none if its source is excluded.
std::optional<SpecificForce> Odometry::force_of(const Sweep& sweep, std::bitset<kMaxSources> without) {
  const std::optional<SpecificForce>& force = sweep.motion.specific_force;
  return force && !without[index_of(force->source)] ? force : std::nullopt;
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
