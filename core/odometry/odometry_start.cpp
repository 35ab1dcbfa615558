// SPDX-License-Identifier: Apache-2.0
// Start of the odometry: its first two sweeps.
#include <algorithm>
#include <chrono>
#include <utility>

#include "core/odometry/odometry.hpp"

namespace locus {

namespace {

/// Least overlap of the first two sweeps for a two-sweep start. Correct starts reach 0.45 and more, two halves of a
/// turn 0.1 to 0.17.
constexpr double kMinOverlap = 0.3;

constexpr double kUnknownRate_radps = 10.0; ///< standard deviation of an unknown turn rate: a flick of a hand
/// Prior odds, as twice their logarithm, of a rest during the first two sweeps: where a source measures the
/// translation; where points alone do, maybe those of people who walk past; of a drive that continues another which
/// ended at rest.
constexpr double kBeginsAtRest = 9.2, kBeginsAtRestUnmeasured = 20.0, kContinuesAtRest = 20.0;
constexpr int kRounds = 8;        ///< most iterations until motion and de-skew of the first two sweeps agree
constexpr double kAgrees = 0.002; ///< change per iteration below which they agree: metres, radians

} // namespace

/// Starts the odometry at the first sweep: at the end of another run, or at the origin with zero yaw, level if gravity
/// is known.
OdometryEstimate Odometry::begin(const Sweep& sweep) {
  OdometryEstimate estimate;
  move_points(sweep, SweepCorrection::all(sweep, corrected_twist(sweep)));
  gravity_.observe(Eigen::Quaterniond::Identity(), sweep);
  estimate.failed = scan_.size() < kMinPoints || (map_.fine().size() > 0 && !relocalise_first(sweep));
  ResumeState here;
  if (start_ && estimate.failed)
    here = start_->moved_to(start_->candidates(sweep.end, sweep.motion, options_.motion.max_speed_mps).front());
  else if (start_)
    here = *start_;
  else if (const auto up_base = gravity_.up_base())
    here.T_odom_base.rotation = from_rpy_rad(level_rpy_rad(*up_base));
  const Vector6 unknown = along_each_axis(options_.motion.max_speed_mps, kUnknownRate_radps / kRadPerDeg);
  filter_.begin(here.T_odom_base, Vector6::Zero(), unknown, here.pose_covariance);
  if (observer_)
    observer_->begin(here.T_odom_base, Vector6::Zero(), unknown, here.pose_covariance);
  if (estimate.failed) { // try again with the next sweep
    estimate.state = TrackingState::dead_reckoning;
  } else {
    if (!beginning_)
      beginning_ = start_ ? Beginning::told : Beginning::origin;
    map_policy_.begin(sweep.end, here.T_odom_base);
    first_ = sweep;
    estimate.keyframe = true;
    if (!run_before_) {
      free_space_.expect(sweep);
      keyframe_observability_ = Matrix6::Zero();
    }
  }
  estimate.stamp = sweep.end;
  estimate.beginning = beginning_;
  estimate.T_odom_base = here.T_odom_base;
  estimate.twist_covariance = filter_.covariance().bottomRightCorner<6, 6>();
  estimate.pose_covariance = filter_.pose_covariance_since_start();
  estimate.points = sweep.registered;
  report_sources(sweep, estimate);
  steps_.store(sweep);
  return estimate;
}

/// Relocalises in the map of another run. If that fails, discards the map and starts at the pose from an odometry
/// source, or at the origin. Returns false while waiting for such a source: along a corridor the sweep fits the map at
/// wrong poses, too, and only that source knows how far the robot has come.
bool Odometry::relocalise_first(const Sweep& sweep) {
  constexpr Duration kPatience = std::chrono::seconds{1}; ///< DDS discovery takes less
  waits_since_ = waits_since_.value_or(sweep.end);
  const std::vector<Candidate> candidates = start_->candidates(sweep.end, sweep.motion, options_.motion.max_speed_mps);
  if (!candidates.front().from_healthy && start_->awaits(sweep.motion) &&
      std::chrono::abs(sweep.end - *waits_since_) < kPatience)
    return false;
  const StageScope scope(clock_, Stage::scan_to_submap);
  if (const auto found =
          relocalise(gicp_, std::span(scan_).first(sweep.registered), map_, candidates, options_.scan_to_submap)) {
    beginning_ = Beginning::map;
    run_before_ = std::exchange(start_, start_->moved_to(found->candidate));
    map_policy_.resume();
    return true;
  }
  map_.clear();
  if (const auto sensed = std::ranges::find_if(candidates, &Candidate::from_odometry); sensed != candidates.end()) {
    beginning_ = Beginning::odometry;
    start_ = start_->moved_to(*sensed);
  } else {
    start_.reset();
  }
  return true;
}

/// Estimates the motion between the first and the second sweep, and de-skews both with it, iteratively. The map then
/// starts with the corrected first sweep. A wrong source distorts both sweeps, and reports a wrong pose in the map of
/// another run.
void Odometry::find_start(const Sweep& sweep, const Gicp::StopRequested& stop) {
  const Sweep first = *std::exchange(first_, std::nullopt);
  const auto start = find_first_motion(first, sweep, stop);
  if (start) {
    stands_ = start->rests;
    begin_filter(filter_.pose(), *start);
    correct(first, start->twist_base, start->without);
  } else if (run_before_) {
    move_points(first, SweepCorrection::all(first, corrected_twist(first)));
  }
  if (start && run_before_) {
    if (!stop()) // a registration cut short fits badly for that reason alone
      relocalise_again(first, sweep, *start);
  } else if (start) {
    lidar_health_.learn(start->fit, steps_.elapsed_s(sweep));
    map_.clear();
  }
  free_space_.clear(); // the first sweep was not de-skewed
  if (start || run_before_) {
    free_space_.expect(first);
    map_.insert(free_space_.leave_out_contradicting(scan_, filter_.pose(), map_), filter_.pose());
  }
  run_before_.reset();
}

void Odometry::begin_filter(const Pose& T_odom_first, const Start& start) {
  const Vector6 sigma = start.rests ? along_each_axis(0.1, 1.0) : along_each_axis(1.0, 10.0);
  const Matrix6 of_map = start_ ? start_->pose_covariance : Matrix6::Zero();
  filter_.begin(T_odom_first, start.twist_base, sigma, of_map);
  if (observer_)
    observer_->begin(T_odom_first, start.twist_base, sigma, of_map);
}

/// Returns the motion between the first two sweeps, or none if their overlap is too small.
std::optional<Odometry::Start> Odometry::find_first_motion(const Sweep& first, const Sweep& sweep,
                                                           const Gicp::StopRequested& stop) {
  if (sweep.points.size() < kMinPoints || steps_.elapsed_s(sweep) <= 0.0 ||
      options_.scan_to_scan_mode == ScanToScanMode::off)
    return std::nullopt;
  const StageScope scope(clock_, Stage::scan_to_scan);
  Start start = start_without({}, first, sweep, stop);
  if (const SourceChoice choice = choose_among(sweep, {}); choice.rotation && !stop())
    if (Start free = start_without(kAllSources, first, sweep, stop);
        evidence(free.fit, start.fit) > odds_of_sources(sweep, {}))
      start = free;
  if (static_cast<double>(start.fit.inliers + start.fit.unknown) < kMinOverlap * static_cast<double>(sweep.registered))
    return std::nullopt;
  return start;
}

/// Relocalises the first sweep again after its de-skew with the motion of the first two. An odometry source that
/// contradicts this motion is doubted: its pose need not be right.
void Odometry::relocalise_again(const Sweep& first, const Sweep& sweep, const Start& start) {
  const StageScope scope(clock_, Stage::scan_to_submap);
  MotionFilter lidar_alone = assume(sweep, {.without = kAllSources}, filter_).filter;
  lidar_alone.update(start.fit.T_target_source, start.twist_base, start.fit.information);
  for (std::size_t i = 0; i < sources_.size(); ++i)
    if (const auto twist_base = steps_.twist_base(sweep, SourceId{i})) {
      const auto ratio = test_ratio(lidar_alone.innovation(SourceId{i}, *twist_base), steps_.elapsed_s(sweep));
      run_before_->doubted[i] = run_before_->doubted[i] || ratio.value_or(0.0) > 1.0;
    }
  const auto found = relocalise(gicp_, std::span(scan_).first(first.registered), map_,
                                run_before_->candidates(first.end, first.motion, options_.motion.max_speed_mps),
                                options_.scan_to_submap);
  if (!found)
    return;
  start_ = run_before_->moved_to(found->candidate);
  begin_filter(start_->T_odom_base, start);
  lidar_health_.learn(found->fit, steps_.elapsed_s(sweep));
}

/// Returns the motion between the first two sweeps with the sources in `without` excluded from the de-skew. A robot
/// usually begins at rest, unless the sources measure a motion: along a corridor two sweeps fit either. One that was in
/// motion when another run ended is at rest only if those sources are wrong.
Odometry::Start Odometry::start_without(std::bitset<kMaxSources> without, const Sweep& first, const Sweep& sweep,
                                        const Gicp::StopRequested& stop) {
  const MotionFilter unknown = assume(sweep, {.without = without}, filter_).filter;
  const Pose T_odom_first = filter_.pose();
  MotionBelief prior = unknown.belief();
  prior.information.setZero(); // estimates the pose only
  prior.information.topLeftCorner<6, 6>() = unknown.covariance().topLeftCorner<6, 6>().inverse();
  const auto match = [&](const Vector6& twist, std::bitset<kMaxSources> unused, const Pose& T_start,
                         const MotionBelief& belief, int iterations) {
    correct(first, twist, unused);
    last_scan_map_.clear();
    last_scan_map_.insert(scan_, T_odom_first);
    correct(sweep, twist, unused);
    const ElasticScan rigid{.points = std::span(scan_).first(sweep.registered), .age_s = {}, .twist_base = twist};
    RegistrationOptions options = options_.scan_to_scan;
    options.max_iterations = std::min(options.max_iterations, iterations);
    return gicp_.align(rigid, last_scan_map_, T_start, belief, options, iterations > 4, stop);
  };
  const Registration rest = match(Vector6::Zero(), kAllSources, T_odom_first,
                                  {T_odom_first, Vector6::Zero(), 1e12 * Matrix12::Identity()}, 4);
  Start start{.without = without, .rests = false, .twist_base = unknown.twist_base(), .fit = {}};
  Pose T_odom_base = unknown.pose();
  for (int round = 0; round < kRounds; ++round) {
    start.fit = match(start.twist_base, without, T_odom_base, prior, options_.scan_to_scan.max_iterations);
    const Pose T_before = std::exchange(T_odom_base, start.fit.T_target_source);
    start.twist_base = se3_log(T_odom_first.inverse() * T_odom_base) / steps_.elapsed_s(sweep);
    if (difference(T_odom_base, T_before).cwiseAbs().maxCoeff() < kAgrees || stop())
      break;
  }
  const double begins_at_rest = choose_among(sweep, without).translation ? kBeginsAtRest : kBeginsAtRestUnmeasured;
  const double odds_of_rest = continues_motion_ ? -odds_of_sources(sweep, {})
                              : start_          ? kContinuesAtRest
                                                : begins_at_rest - unknown.surprise_at_rest();
  if (evidence(rest, start.fit) + odds_against_stuck(repeating_sources(sweep)).value_or(0.0) > -odds_of_rest)
    start = {.without = kAllSources, .rests = true, .twist_base = Vector6::Zero(), .fit = rest};
  return start;
}

} // namespace locus
