// SPDX-License-Identifier: Apache-2.0
#include "core/odometry/odometry.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "core/ingest/deskew.hpp"
#include "core/odometry/relocation.hpp"
#include "core/sources/motion_sources.hpp"

namespace locus {

namespace {

constexpr std::size_t kMinPoints = 30; ///< fewer say nothing reliable about six axes

/// Least share of the points that must find a correspondence for a registration to be believed.
constexpr double kMinInlierShare = 0.1;

/// Of the points of the second sweep, those that the first must have seen, too, if the motion between them is to be
/// found: honest starts have 0.45 and more, two halves of a turn 0.1 to 0.17.
constexpr double kMinOverlap = 0.3;

/// What misses most of the usual correspondences may contradict the motion sources by no more than this.
constexpr double kLoneDeviation_sigma = 3.0;

/// A belief that is less sure than this looks for correspondences all around each point.
constexpr double kWide_m = 0.3;

/// A twist that the points were not corrected for bends a block of them: so much of it and they are corrected anew.
constexpr double kBends_mps = 0.3, kBends_radps = 0.05;

/// A hypothesis that assumes less than another may fit so much worse than that; that the robot still stands, less: a
/// robot that pulls away would be held back.
constexpr double kAsGood = 0.99, kAsGoodAtRest = 0.998;

/// What a robot that comes to rest is slower than, for how long.
const Vector6 kSlow = along_each_axis(0.05, 2.0);
constexpr double kSlowDoubt = 4.0;
constexpr Duration kSlowFor = std::chrono::milliseconds{500};
constexpr double kRest_sigma = 3.0;

constexpr double kUnknownRate_radps = 100.0; ///< of a robot of which nothing is known
constexpr int kStartRounds = 8;        ///< at the most, until motion and correction of the first two sweeps agree:
constexpr double kStartAgrees = 0.002; ///< metres, radians

/// Room for the 16 000 voxels of a large sweep, and small enough for the second cache.
constexpr std::size_t kLastScanBytes = 2'500'000;

const std::bitset<kMaxSources> kAllSources = std::bitset<kMaxSources>{}.set();

/// So many lengths of a sweep after the last one, sweeps were dropped in between.
constexpr double kDropped = 1.5;

/// Of what sweeps to come are laid against, the part that a sweep makes up. If a share s of it is new, then 2/s - 1
/// sweeps are in sight at a time, and a step of the mean over so many shifts it by 2s/(1 + s) of a step in the end.
/// Along axes that no surface constrains nothing old holds it back.
Matrix6 share_of_map(double fresh, const Matrix6& observability) {
  const Matrix6 all = Matrix6::Identity();
  const Matrix6 seen = observability / SeenAxes::kWeakBelow;
  const Matrix6 unseen = (seen * seen + all).inverse();
  const double share = 2.0 * fresh / (1.0 + fresh);
  return share * all + (1.0 - share) * unseen;
}

} // namespace

Odometry::Odometry(const OdometryOptions& options, const std::vector<MotionSourceOptions>& sources, StageClock* clock)
    : options_(options), sources_(sources), clock_(clock), gicp_(options.threads, options.isa),
      flat_ground_(options.flat_ground), map_(options.map.max_bytes, options.isa),
      last_scan_map_(kLastScanBytes, options.isa), map_policy_(options.map), filter_(sources, options.motion) {}

void Odometry::begin_at(const Whereabouts& last, std::span<const SurfacePoint> map_odom) {
  start_ = last;
  map_.insert(map_odom, Pose{});
}

OdometryEstimate Odometry::process(const Sweep& sweep, const Gicp::StopRequested& stop) {
  prepare_next();
  if (!beginning_)
    return begin(sweep);
  if (first_)
    find_start(sweep, stop);
  Hypothesis best = choose(sweep, stop);
  const Pose T_odom_last = filter_.pose();
  filter_ = best.filter;
  OdometryEstimate estimate;
  estimate.scan_to_scan = best.scan_to_scan;
  estimate.scan_to_submap = best.fit;
  static_cast<SourceChoice&>(estimate.prior) = best.choice;
  estimate.prior.otherwise = options_.no_source_prior;
  estimate.failed = !best.placed;
  if (estimate.failed) {
    estimate.state = TrackingState::dead_reckoning;
  } else if (best.rests) {
    estimate.state = TrackingState::standstill;
  } else {
    filter_.see(best.fit.T_target_source, best.fit.twist_base, best.fit.information);
  }
  if (!estimate.failed)
    filter_.learn();
  if (!estimate.failed)
    lidar_health_.learn(best.fit, aged_.size(), steps_.elapsed_s(sweep));
  stands_ = best.rests;
  correct(sweep, filter_.twist_base(), best.rests ? kAllSources : best.without);
  if (flat_ground_.holds())
    filter_.put(flat_ground_.flatten(T_odom_last, filter_.pose(),
                                     estimate.failed ? Matrix6::Zero().eval()
                                                     : best.fit.information.topLeftCorner<6, 6>().eval()));
  finish(sweep, estimate);
  return estimate;
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
  const double fresh = map_.insert(scan_, filter_.pose());
  filter_.keep(share_of_map(fresh, *keyframe_observability_));
  keyframe_observability_.reset();
}

/// The world begins at the first sweep: where another run has ended, or at its origin, without yaw, level if gravity is
/// known.
OdometryEstimate Odometry::begin(const Sweep& sweep) {
  OdometryEstimate estimate;
  correct_all(sweep, corrected_twist(sweep), scan_);
  gravity_.observe(Eigen::Quaterniond::Identity(), sweep);
  estimate.failed = scan_.size() < kMinPoints || (map_.fine().size() > 0 && !find_again(sweep));
  Whereabouts here;
  if (start_ && estimate.failed)
    here = start_->moved_to(start_->places(sweep.end, sweep.motion, options_.motion.max_speed_mps).front());
  else if (start_)
    here = *start_;
  else if (const auto up_base = gravity_.up_base())
    here.T_odom_base.rotation = from_rpy_rad(level_rpy_rad(*up_base));
  filter_.begin(here.T_odom_base, Vector6::Zero(), along_each_axis(options_.motion.max_speed_mps, kUnknownRate_radps),
                here.pose_covariance);
  if (estimate.failed) { // the next sweep is the first
    estimate.state = TrackingState::dead_reckoning;
  } else {
    if (!beginning_)
      beginning_ = start_ ? Beginning::told : Beginning::origin;
    map_policy_.begin(sweep.end, here.T_odom_base);
    first_ = sweep;
    estimate.keyframe = true;
    keyframe_observability_ = Matrix6::Zero();
  }
  estimate.stamp = sweep.end;
  estimate.beginning = beginning_;
  estimate.T_odom_base = here.T_odom_base;
  estimate.twist_covariance = filter_.covariance().bottomRightCorner<6, 6>();
  estimate.pose_covariance = filter_.pose_covariance_since_start();
  estimate.points = sweep.registered;
  steps_.remember(sweep);
  return estimate;
}

/// Looks for the robot in the map that another run has left. Where it is not found the map is given up, and it begins
/// where an odometry says, or at the origin. False while it is too early to say.
bool Odometry::find_again(const Sweep& sweep) {
  constexpr Duration kPatience = std::chrono::seconds{1}; ///< publishers find each other faster
  waits_since_ = waits_since_.value_or(sweep.end);
  const StageScope scope(clock_, Stage::scan_to_submap);
  const std::vector<Place> places = start_->places(sweep.end, sweep.motion, options_.motion.max_speed_mps);
  const bool waits =
      !places.front().told && start_->awaits(sweep.motion) && std::chrono::abs(sweep.end - *waits_since_) < kPatience;
  if (const auto found =
          relocate(gicp_, std::span(scan_).first(sweep.registered), map_, places, options_.scan_to_submap, waits)) {
    beginning_ = Beginning::map;
    start_ = start_->moved_to(*found);
    map_policy_.resume();
    return true;
  }
  if (waits)
    return false;
  map_.clear();
  if (places.front().told) {
    beginning_ = Beginning::odometry;
    start_ = start_->moved_to(places.front());
  } else {
    start_.reset();
  }
  return true;
}

/// The first sweep came without any idea of the motion. What is found between it and the second corrects both, so it
/// can be found better; then the map begins anew with the first one corrected. A source that is wrong bends both.
void Odometry::find_start(const Sweep& sweep, const Gicp::StopRequested& stop) {
  const Sweep first = *std::exchange(first_, std::nullopt);
  if (beginning_ == Beginning::map || sweep.points.size() < kMinPoints || steps_.elapsed_s(sweep) <= 0.0 ||
      options_.scan_to_scan_mode == ScanToScanMode::off)
    return;
  const StageScope scope(clock_, Stage::scan_to_scan);
  Start start = start_without({}, first, sweep, stop);
  if (choose_among(sweep, {}).rotation && !stop())
    if (Start free = start_without(kAllSources, first, sweep, stop); fit_of(free.fit) > fit_of(start.fit) / kAsGood)
      start = free;
  if (static_cast<double>(start.fit.inliers) < kMinOverlap * static_cast<double>(sweep.registered))
    return;
  const Pose T_odom_first = filter_.pose();
  lidar_health_.learn(start.fit, sweep.registered, steps_.elapsed_s(sweep));
  stands_ = start.rests;
  filter_.begin(T_odom_first, start.twist_base, stands_ ? along_each_axis(0.1, 1.0) : along_each_axis(1.0, 10.0),
                start_ ? start_->pose_covariance : Matrix6::Zero());
  correct(first, start.twist_base, start.without);
  map_.clear();
  map_.insert(scan_, T_odom_first);
}

/// The motion between the first two sweeps, if their points are corrected as some sources would not have it.
Odometry::Start Odometry::start_without(std::bitset<kMaxSources> without, const Sweep& first, const Sweep& sweep,
                                        const Gicp::StopRequested& stop) {
  const MotionFilter unknown = assume(sweep, without, false).filter;
  const Pose T_odom_first = filter_.pose();
  MotionBelief prior = unknown.belief();
  prior.information.setZero(); // the pose alone is looked for
  prior.information.topLeftCorner<6, 6>() = unknown.covariance().topLeftCorner<6, 6>().inverse();
  const auto match = [&](const Vector6& twist, std::bitset<kMaxSources> unused, const Pose& T_start,
                         const MotionBelief& belief, int iterations) {
    correct(first, twist, unused);
    last_scan_map_.clear();
    last_scan_map_.insert(scan_, T_odom_first);
    correct(sweep, twist, unused);
    const ElasticScan rigid{.points = std::span(scan_).first(sweep.registered), .block_age_s = {}, .twist_base = twist};
    RegistrationOptions options = options_.scan_to_scan;
    options.max_iterations = std::min(options.max_iterations, iterations);
    return gicp_.align(rigid, last_scan_map_, T_start, belief, options, iterations > 4, stop);
  };
  const Registration rest = match(Vector6::Zero(), kAllSources, T_odom_first,
                                  {T_odom_first, Vector6::Zero(), 1e12 * Matrix12::Identity()}, 4);
  Start start{.without = without, .rests = false, .twist_base = unknown.twist_base(), .fit = {}};
  Pose T_odom_base = unknown.pose();
  for (int round = 0; round < kStartRounds; ++round) {
    start.fit = match(start.twist_base, without, T_odom_base, prior, options_.scan_to_scan.max_iterations);
    const Pose T_before = std::exchange(T_odom_base, start.fit.T_target_source);
    start.twist_base = se3_log(T_odom_first.inverse() * T_odom_base) / steps_.elapsed_s(sweep);
    if (difference(T_odom_base, T_before).cwiseAbs().maxCoeff() < kStartAgrees || stop())
      break;
  }
  if (fit_of(rest) > kAsGood * fit_of(start.fit))
    start = {.without = kAllSources, .rests = true, .twist_base = Vector6::Zero(), .fit = rest};
  return start;
}

/// Of the sources that can be used.
SourceChoice Odometry::choose_among(const Sweep& sweep, std::bitset<kMaxSources> without) const {
  return choose_sources([this](SourceId source) { return sources_[index_of(source)].kind; }, sources_.size(),
                        options_.fusion,
                        [&](SourceId source) { return !without[index_of(source)] && steps_.is_usable(sweep, source); });
}

/// By how much the base moves otherwise during the sweep than on the mean since the last one, as far as sources tell:
/// nothing, unless sweeps were dropped in between.
Vector6 Odometry::unlike_mean(const Sweep& sweep) const {
  Vector6 difference = Vector6::Zero();
  if (steps_.elapsed_s(sweep) < kDropped * to_seconds(sweep.end - sweep.start))
    return difference;
  const Vector6 during_sweep = corrected_twist(sweep);
  const auto [rotation, translation] = choose_among(sweep, {});
  if (translation)
    difference.head<3>() = (during_sweep - *steps_.twist_base(sweep, *translation)).head<3>();
  if (rotation)
    difference.tail<3>() = (during_sweep - *steps_.twist_base(sweep, *rotation)).tail<3>();
  return difference;
}

/// What the filter makes of the sources, before a look at the points.
Odometry::Hypothesis Odometry::assume(const Sweep& sweep, std::bitset<kMaxSources> without, bool rests) const {
  Hypothesis hypothesis{.without = without,
                        .rests = rests,
                        .placed = false,
                        .choice = {},
                        .filter = filter_,
                        .scan_to_scan = {},
                        .fit = {}};
  hypothesis.choice = choose_among(sweep, without);
  const auto& [rotation, translation] = hypothesis.choice;
  const bool free = without.all();
  MotionFilter& filter = hypothesis.filter;
  filter.predict(std::max(steps_.elapsed_s(sweep), 1e-6), to_seconds(sweep.end - sweep.start),
                 free ? std::nullopt : sweep.motion.specific_force,
                 {.translation = free || translation, .rotation = free || rotation});
  if (rotation)
    filter.measure(*rotation, *steps_.twist_base(sweep, *rotation),
                   {.translation = translation == rotation, .rotation = true});
  if (translation && translation != rotation)
    filter.measure(*translation, *steps_.twist_base(sweep, *translation), {.translation = true, .rotation = false});
  if (rests)
    filter.rest();
  if (!rotation && !translation && options_.no_source_prior == NoSourcePrior::identity)
    filter.expect_rest();
  filter.move();
  return hypothesis;
}

/// Where the sweep lies beside the last one, from where the hypothesis has it. That is where the search in the submap
/// begins and no measurement: the submap holds the last sweep, too.
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

/// Lays the sweep into the submap, from where the hypothesis has it.
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
  correct(sweep, belief.twist_base, hypothesis.rests ? kAllSources : hypothesis.without);
  if (sweep.points.size() < kMinPoints)
    return;
  if (has_last_scan_ && !hypothesis.rests)
    match_last(sweep, belief, hypothesis, stop);
  const StageScope scope(clock_, Stage::scan_to_submap);
  const bool wide =
      !hypothesis.rests && hypothesis.filter.covariance().diagonal().head<3>().maxCoeff() > kWide_m * kWide_m;
  const Pose T_start = hypothesis.fit.T_target_source;
  hypothesis.fit = gicp_.align(aged_.sort(sweep, scan_, belief.twist_base), map_, T_start, belief, options, wide, stop);
  const Vector6 bent = (hypothesis.fit.twist_base - belief.twist_base).cwiseAbs();
  const bool bends = bent.head<3>().maxCoeff() >= kBends_mps || bent.tail<3>().maxCoeff() >= kBends_radps;
  if (!bends || stop())
    return;
  const int before = hypothesis.fit.iterations;
  correct(sweep, hypothesis.fit.twist_base, hypothesis.without);
  hypothesis.fit = gicp_.align(aged_.sort(sweep, scan_, hypothesis.fit.twist_base), map_,
                               hypothesis.fit.T_target_source, belief, options, false, stop);
  hypothesis.fit.iterations += before;
}

/// Of what may be true, what fits the surfaces best; of what fits as well, what believes the sources, and rest.
Odometry::Hypothesis Odometry::choose(const Sweep& sweep, const Gicp::StopRequested& stop) {
  const auto attempt = [&](std::bitset<kMaxSources> without, bool rests) {
    Hypothesis hypothesis = assume(sweep, without, rests);
    register_with(sweep, hypothesis, stop);
    return hypothesis;
  };
  Hypothesis best = attempt({}, false);
  gravity_.observe(filter_.pose().rotation.conjugate() * best.filter.pose().rotation, sweep);
  flat_ground_.observe(sweep.end, gravity_.up_base());
  if (sweep.points.size() < kMinPoints)
    return best;
  Hypothesis first = best;
  const auto contradicted = worst_source(sweep, best);
  const bool in_doubt = contradicted || (lidar_health_.is_unusual(best.fit, aged_.size()) && best.choice.rotation);
  if (in_doubt && !stop()) { // what was cut short fits badly for that alone
    std::bitset<kMaxSources> without = best.without;
    without.set(contradicted.value_or(index_of(*best.choice.rotation)));
    if (Hypothesis other = attempt(without, false);
        fit_of(other.fit) > kAsGood * fit_of(best.fit) &&
        (contradicted || !lidar_health_.is_unusual(other.fit, aged_.size())))
      best = other;
    if (lidar_health_.is_unusual(best.fit, aged_.size()))
      if (Hypothesis free = attempt(kAllSources, false); fit_of(free.fit) > fit_of(best.fit) / kAsGood)
        best = free;
  }
  const Vector6 twist = best.filter.twist_base();
  const Vector6 sigma = best.filter.covariance().diagonal().tail<6>().cwiseSqrt();
  const bool may_rest = (twist.array().abs() < kRest_sigma * sigma.array() + 1e-3).all();
  MotionFilter after = best.filter;
  after.see(best.fit.T_target_source, best.fit.twist_base, best.fit.information);
  const Vector6 doubt = after.covariance().diagonal().tail<6>().cwiseSqrt();
  const bool slow = (best.fit.twist_base.array().abs() < kSlow.array()).all() &&
                    (doubt.array() < kSlowDoubt * kSlow.array()).all(); // who does not see does not see that it stands
  if (!slow)
    slow_since_ = sweep.end;
  if (may_rest && (stands_ || sweep.end - slow_since_ >= kSlowFor)) {
    if (Hypothesis rest = attempt(best.without, true); fit_of(rest.fit) > kAsGoodAtRest * fit_of(best.fit)) {
      rest.filter.put(filter_.pose());
      best = rest;
    }
  }
  if (!best.rests && !is_placed(sweep, best.fit, first))
    return first; // what carries on unseen is what the sources say
  best.placed = true;
  return best;
}

/// Takes out of the points what they were not corrected for, of a base that moved with `twist_base` since the last
/// sweep, on the mean.
void Odometry::correct(const Sweep& sweep, const Vector6& twist_base, std::bitset<kMaxSources> without) {
  if (without.any())
    correct_anew(sweep, twist_base, scan_);
  else
    correct_all(sweep, twist_base + unlike_mean(sweep), scan_);
}

/// The source that contradicts what all others say most, if any does.
std::optional<std::size_t> Odometry::worst_source(const Sweep& sweep, const Hypothesis& hypothesis) const {
  MotionFilter after = hypothesis.filter;
  after.see(hypothesis.fit.T_target_source, hypothesis.fit.twist_base, hypothesis.fit.information);
  std::optional<std::size_t> worst;
  double most = 1.0; // from there on it is contradicted
  for (const auto& source : {hypothesis.choice.rotation, hypothesis.choice.translation}) {
    if (!source)
      continue;
    const Innovation found = after.innovation(*source, *steps_.twist_base(sweep, *source));
    const double ratio = test_ratio(found, steps_.elapsed_s(sweep)).value_or(0.0);
    if (ratio > most) {
      most = ratio;
      worst = index_of(*source);
    }
  }
  return worst;
}

/// Whether a registration is believed. What misses most of what is usually seen gives way to motion sources that say
/// otherwise, as `all_sources` has them, unless nothing was seen for a while.
bool Odometry::is_placed(const Sweep& sweep, const Registration& fit, const Hypothesis& all_sources) const {
  if (fit.iterations == 0 || !fit.T_target_source.finite() ||
      static_cast<double>(fit.inliers) < kMinInlierShare * static_cast<double>(aged_.size()))
    return false;
  const bool had_sight = saw_ || (map_policy_.is_refused() && map_policy_.was_placed_lately(sweep.end));
  if (!all_sources.choice.translation || !had_sight || !lidar_health_.misses_most(fit, aged_.size()))
    return true;
  const Vector6 deviation = difference(fit.T_target_source, all_sources.filter.pose()).cwiseAbs();
  const Vector6 sigma = all_sources.filter.covariance().diagonal().head<6>().cwiseSqrt();
  return (deviation.array() <= kLoneDeviation_sigma * sigma.array()).all();
}

/// What a placed sweep says of what lidar sees and of the motion sources.
void Odometry::report(const Sweep& sweep, OdometryEstimate& estimate) {
  const Matrix6 R = turn_both(estimate.T_odom_base.rotation);
  estimate.observability = seen_axes_.observe(R.transpose() * estimate.scan_to_submap.observability * R);
  if (!seen_axes_.all() && estimate.state == TrackingState::tracking)
    estimate.state = TrackingState::degenerate;
  if (!saw_)
    return; // the way back to the submap is no motion of the robot
  for (std::size_t i = 0; i < sources_.size(); ++i)
    if (const auto twist_base = steps_.twist_base(sweep, SourceId{i})) {
      const Innovation innovation = filter_.innovation(SourceId{i}, *twist_base);
      source_reports_[i].innovation = innovation;
      source_reports_[i].test_ratio = test_ratio(innovation, steps_.elapsed_s(sweep)).value_or(0.0);
      feedback_.opinions[i] = opinion_on(innovation, steps_.elapsed_s(sweep));
    }
  feedback_.twist_base = seen_axes_.part_of(filter_.twist_base());
  feedback_.sees = seen_axes_.each();
}

/// Fills in what the estimate says beside its pose, and remembers the sweep as the last.
void Odometry::finish(const Sweep& sweep, OdometryEstimate& estimate) {
  estimate.stamp = sweep.end;
  estimate.beginning = beginning_;
  estimate.points = sweep.registered;
  estimate.T_odom_base = filter_.pose();
  feedback_ = {.from = steps_.last(), .to = sweep.end, .opinions = {}, .twist_base = Vector6::Zero(), .sees = {}};
  if (!estimate.failed)
    report(sweep, estimate);
  for (const auto& source : {estimate.prior.rotation, estimate.prior.translation})
    if (source)
      source_reports_[index_of(*source)].last_used = sweep.end;
  for (std::size_t i = 0; i < sources_.size(); ++i) {
    const SourcePose& seen = sweep.motion.sources[i];
    source_reports_[i].T_source_base =
        seen.usable && sources_[i].kind == SourceKind::odometry ? std::optional{seen.T_source_base} : std::nullopt;
  }
  estimate.sources = source_reports_;
  saw_ = !estimate.failed;
  scan_is_next_target_ = saw_ && options_.scan_to_scan_mode == ScanToScanMode::always;
  tilt_keeper_.observe(estimate.T_odom_base.rotation, gravity_.up_base());
  const MapPolicy::Verdict verdict =
      map_policy_.judge({.stamp = sweep.end,
                         .T_odom_base = estimate.T_odom_base,
                         .placed = !estimate.failed,
                         .has_points = scan_.size() >= kMinPoints,
                         .misses_most = lidar_health_.misses_most(estimate.scan_to_submap, aged_.size()),
                         .carried = estimate.prior.translation.has_value()});
  if (verdict == MapPolicy::Verdict::begins_anew)
    map_.clear();
  if (verdict != MapPolicy::Verdict::waits) {
    estimate.keyframe = true;
    keyframe_observability_ = estimate.scan_to_submap.observability;
    filter_.put({(so3_exp(tilt_keeper_.take_correction_rad()) * estimate.T_odom_base.rotation).normalized(),
                 estimate.T_odom_base.translation});
    estimate.T_odom_base = filter_.pose();
  }
  estimate.twist_base = filter_.twist_base();
  estimate.twist_covariance = filter_.covariance().bottomRightCorner<6, 6>();
  estimate.pose_covariance = filter_.pose_covariance_since_start();
  for (std::size_t i = 0; i < sources_.size(); ++i)
    if (!sweep.motion.sources[i].usable)
      filter_.forget(SourceId{i}); // what comes back may come back as another
  steps_.remember(sweep);
}

} // namespace locus
