// SPDX-License-Identifier: Apache-2.0
#include "core/odometry/odometry.hpp"

#include <algorithm>
#include <cmath>

#include "core/ingest/deskew.hpp"
#include "core/odometry/relocation.hpp"

namespace locus {

namespace {

constexpr std::size_t kMinPoints = 30; ///< fewer say nothing reliable about six axes

/// Least share of the points that must find a correspondence for a registration to be believed.
constexpr double kMinInlierShare = 0.1;

/// A registration that contradicts the prior by more than this many standard deviations, and by more than the least, is
/// refused.
constexpr double kMaxDeviation_sigma = 8.0;
constexpr double kAlwaysAllowed_m = 0.5;
constexpr double kAlwaysAllowed_rad = 0.1;

/// A source of the rotation is put to the vote if, about any axis, it turns otherwise than the robot would without it
/// by more than this many standard deviations of that and by more than the least, or by more than kAlwaysAllowed_rad.
constexpr double kDispute_sigma = 6.0;
constexpr double kLeastDispute_rad = 0.02;

/// No place changes so fast that from one sweep to the next less than this part of the usual correspondences is left:
/// the air is full of dust, or the lidar measures otherwise than before. Such a sweep is not for the map, and may
/// contradict the motion sources by no more than this. (The worst of honest drives is 0.78; in dust, 2.2 sigma.)
constexpr double kLeastOfUsual = 0.5;
constexpr double kLoneDeviation_sigma = 3.0;
constexpr double kMemoryOfUsual_sweeps = 10.0;

/// A lidar that falls silent leaves a last sweep that is hardly begun. A sweep of so few points, as part of the usual,
/// tells a place but no velocity: what noise there is in it would carry the robot away for as long as nothing is seen.
constexpr double kFragment = 1.0 / 3.0;

/// A robot of which nothing is seen is taken to go on as it did for so long, and to come to rest then.
constexpr Duration kGoesOn = std::chrono::seconds{1};
constexpr double kComesToRest_s = 1.0;

/// After so many refusals in a row the submap is behind us, and the map goes on from the prediction. Where wheels or
/// legs carry the estimate it waits, for so long since lidar last placed the robot: what is measured wrong must not get
/// into the map.
constexpr int kRefusalsToRestart = 10;
constexpr Duration kLately = std::chrono::seconds{5};

/// Of what was not foreseen of the motion in a sweep, how much shows in where it comes to lie, how far a turn shifts
/// it, for what it sees stands to one side, and how much of that goes on in the next.
constexpr double kAskew = 0.4;
constexpr double kArm_m = 2.0;
constexpr double kShakesOn = 0.7;

/// A prior that is less sure than this looks for correspondences all around each point.
constexpr double kWide_m = 0.3;

constexpr int kStartRounds = 8;        ///< at the most, until motion and correction of the first two sweeps agree:
constexpr double kStartAgrees = 0.002; ///< metres, radians

/// Room for the 16 000 voxels of a large sweep, and small enough for the second cache.
constexpr std::size_t kLastScanBytes = 2'500'000;

/// Of two registrations of the same points. A point without a correspondence counts as one that is three sigma off.
bool fits_better(const Registration& one, const Registration& other) {
  constexpr double kMissing = 9.0;
  const auto gain = [](const Registration& fit) {
    return static_cast<double>(fit.inliers) * (kMissing - fit.mean_error);
  };
  return gain(one) > gain(other);
}

} // namespace

Odometry::Odometry(const OdometryOptions& options, const std::vector<MotionSourceOptions>& sources, StageClock* clock)
    : options_(options), clock_(clock), gicp_(options.threads, options.isa), flat_ground_(options.flat_ground),
      map_(options.map.max_bytes, options.isa), last_scan_map_(kLastScanBytes, options.isa),
      sensors_(options, sources) {}

OdometryEstimate Odometry::process(const Sweep& sweep, const Gicp::StopRequested& stop) {
  prepare_next();
  if (processed_ == 0)
    return begin(sweep);
  const MotionPrior prior = settle_dispute(sweep, sensors_.integrate(sweep, kept_twist(sweep)), stop);
  lacks_prior_ = needs_scan_to_scan(prior);
  gravity_.observe(prior.T_last_now.rotation, sweep);
  flat_ground_.observe(sweep.end, gravity_.up_base());
  Pose T_last_now = prior.T_last_now;
  correct_motion(sweep, T_last_now);

  OdometryEstimate estimate;
  estimate.scan_to_scan = match_scan(prior, T_last_now, prior.blind, stop);
  if (trusts(estimate.scan_to_scan, estimate.scan_to_scan.T_target_source, prior.T_last_now, prior.variance)) {
    if (prior.blind)
      begin_again(sweep, prior, estimate.scan_to_scan, stop);
    const Matrix6 R = turn_both(T_odom_last_.rotation);
    T_last_now = flatten(estimate.scan_to_scan.T_target_source, R * estimate.scan_to_scan.information * R.transpose());
    correct_motion(sweep, T_last_now);
  }
  estimate.scan_to_scan.T_target_source = T_last_now; // also where it was not trusted
  const PoseUncertainty before = uncertainty_;
  predict(prior);
  estimate.scan_to_submap = match_submap(prior, T_last_now, stop);
  const Pose T_last_submap = T_odom_last_.inverse() * estimate.scan_to_submap.T_target_source;
  estimate.failed = !trusts(estimate.scan_to_submap, T_last_submap, prior.T_last_now, variance_against_submap()) ||
                    is_outvoted(sweep, estimate.scan_to_submap, T_last_submap, prior);
  estimate.T_odom_base = T_odom_last_ * (estimate.failed ? flatten(T_last_now, Matrix6::Zero())
                                                         : flatten(T_last_submap, estimate.scan_to_submap.information));
  hold_still(sweep, estimate);
  if (estimate.state == TrackingState::standstill)
    uncertainty_ = before; // standing adds nothing
  finish(sweep, prior, estimate);
  return estimate;
}

void Odometry::prepare_next() {
  if (keyframe_observability_) {
    const StageScope scope(clock_, Stage::map);
    const double fresh = map_.insert(last_scan_, T_odom_last_);
    uncertainty_.keep(share_of_map(fresh, *keyframe_observability_));
    keyframe_observability_.reset();
  }
  if (lacks_prior_ && !last_scan_mapped_) // most likely the next one will, too
    map_last_scan(last_registered_);
}

/// The target of scan-to-scan: the first so many points of the last sweep.
void Odometry::map_last_scan(std::size_t points) {
  const StageScope scope(clock_, Stage::scan_to_scan);
  last_scan_map_.clear();
  last_scan_map_.insert(std::span(last_scan_).first(points), Pose{});
  last_scan_mapped_ = true;
}

void Odometry::begin_at(const Pose& T_odom_base, std::span<const SurfacePoint> map_odom) {
  T_odom_start_ = T_odom_base;
  knows_start_ = !map_odom.empty();
  map_.insert(map_odom, Pose{});
}

/// The world begins at the first sweep: where it is told to, or at its origin, without yaw, level if gravity is known.
OdometryEstimate Odometry::begin(const Sweep& sweep) {
  correct_all(sweep.points, Vector6::Zero(), options_.isa, scan_);
  registered_ = sweep.registered;
  gravity_.observe(Eigen::Quaterniond::Identity(), sweep);
  if (T_odom_start_)
    T_odom_last_ = *T_odom_start_;
  if (knows_start_ && scan_.size() >= kMinPoints) {
    const StageScope scope(clock_, Stage::scan_to_submap);
    const std::optional<Pose> T_odom_found =
        relocate(gicp_, registered(), map_, *T_odom_start_, options_.scan_to_submap);
    resumed_ = T_odom_found.has_value();
    knows_start_ = false;
    T_odom_last_ = T_odom_found.value_or(Pose{});
    if (!resumed_) {
      T_odom_start_.reset();
      map_.clear();
    }
  }
  if (const auto up_base = gravity_.up_base(); up_base && !T_odom_start_)
    T_odom_last_.rotation = from_rpy_rad(level_rpy_rad(*up_base));
  if (sweep.uncorrected != Uncorrected::nothing && !resumed_)
    first_ = sweep;
  OdometryEstimate estimate;
  estimate.T_odom_base = T_odom_last_;
  estimate.failed = scan_.size() < kMinPoints;
  finish(sweep, MotionPrior{}, estimate);
  if (estimate.failed)
    processed_ = 0; // nothing was seen yet: the next sweep is the first
  return estimate;
}

/// The velocity in the last sweep, as far as it may have lasted; nothing where there was no motion to tell it from.
std::optional<Vector6> Odometry::kept_twist(const Sweep& sweep) const {
  if (processed_ < 2)
    return std::nullopt;
  if (sweep.end - last_seen_ <= kGoesOn)
    return twist_base_;
  return twist_base_ * std::exp(-std::max(0.0, sensors_.elapsed_s(sweep)) / kComesToRest_s);
}

/// Where the source of the rotation turns quite otherwise than the robot would without it, the surfaces say which is
/// true: as a prior, a gyro is too sure for them to say so later. The loser makes the winner less sure.
MotionPrior Odometry::settle_dispute(const Sweep& sweep, const MotionPrior& prior, const Gicp::StopRequested& stop) {
  source_is_refuted_ = false;
  if (!prior.source.rotation || !had_sight(sweep) || sweep.points.size() < kMinPoints)
    return prior;
  const MotionPrior rival = sensors_.integrate(sweep, kept_twist(sweep), prior.source.rotation);
  const Eigen::Vector3d dispute = difference(prior.T_last_now, rival.T_last_now).tail<3>();
  const Eigen::Vector3d usual =
      (kDispute_sigma * rival.variance.tail<3>().cwiseSqrt()).cwiseMax(kLeastDispute_rad).cwiseMin(kAlwaysAllowed_rad);
  if ((dispute.array().abs() < usual.array()).all())
    return prior;
  const Registration with_source = attempt(sweep, prior.T_last_now, stop);
  source_is_refuted_ = true;
  const Registration without_source = attempt(sweep, rival.T_last_now, stop);
  MotionPrior accepted = rival;
  if (!fits_better(without_source, with_source)) {
    accepted = prior;
    source_is_refuted_ = false;
  }
  accepted.variance.tail<3>() += dispute.cwiseAbs2();
  return accepted;
}

/// Lays the sweep into the submap from where T_last_now takes it, with nothing to hold it there.
Registration Odometry::attempt(const Sweep& sweep, const Pose& T_last_now, const Gicp::StopRequested& stop) {
  correct_motion(sweep, T_last_now);
  const StageScope scope(clock_, Stage::scan_to_submap);
  const Pose T_start = T_odom_last_ * T_last_now;
  return gicp_.align(registered(), map_, T_start, {.T_target_source = T_start}, options_.scan_to_submap, true, stop);
}

/// Takes out of the points what no motion source could, with the twist that T_last_now means.
void Odometry::correct_motion(const Sweep& sweep, const Pose& T_last_now) {
  correct(sweep, twist_in(sweep, T_last_now), scan_);
  registered_ = sweep.registered;
}

void Odometry::correct(const Sweep& sweep, const Vector6& twist_base, std::vector<SurfacePoint>& scan) const {
  if (source_is_refuted_)
    return correct_anew(sweep, twist_base, scan);
  Vector6 uncorrected = twist_base;
  if (sweep.uncorrected == Uncorrected::nothing)
    uncorrected.setZero();
  if (sweep.uncorrected == Uncorrected::translation)
    uncorrected.tail<3>().setZero();
  correct_all(sweep.points, uncorrected, options_.isa, scan);
}

/// The twist that takes the base from the last sweep to this one; zero where no time has passed.
Vector6 Odometry::twist_in(const Sweep& sweep, const Pose& T_last_now) const {
  const double elapsed_s = sensors_.elapsed_s(sweep);
  return elapsed_s > 0.0 ? (se3_log(T_last_now) / elapsed_s).eval() : Vector6::Zero();
}

bool Odometry::needs_scan_to_scan(const MotionPrior& prior) const {
  return options_.scan_to_scan_mode == ScanToScanMode::always ||
         (options_.scan_to_scan_mode == ScanToScanMode::automatic && !prior.source.translation);
}

Registration Odometry::match_scan(const MotionPrior& prior, const Pose& T_start, bool wide,
                                  const Gicp::StopRequested& stop) {
  Registration none;
  none.T_target_source = T_start;
  if (!needs_scan_to_scan(prior) || scan_.size() < kMinPoints)
    return none;
  if (!last_scan_mapped_) // once the motion is roughly known, the points that are registered make map enough
    map_last_scan(prior.blind ? last_scan_.size() : last_registered_);
  const StageScope scope(clock_, Stage::scan_to_scan);
  const PosePrior pose_prior{prior.T_last_now, prior.variance.cwiseInverse().asDiagonal()};
  return gicp_.align(registered(), last_scan_map_, T_start, pose_prior, options_.scan_to_scan, wide, stop);
}

/// The first two sweeps came without any idea of the motion. What was found between them corrects both, so it can be
/// found better; then the map begins anew with the first one corrected.
void Odometry::begin_again(const Sweep& sweep, const MotionPrior& prior, Registration& found,
                           const Gicp::StopRequested& stop) {
  if (first_.points.empty())
    return;
  for (int round = 0; round < kStartRounds; ++round) {
    const Pose T_last_now = found.T_target_source;
    correct(first_, twist_in(sweep, T_last_now), last_scan_);
    last_scan_mapped_ = false;
    correct_motion(sweep, T_last_now);
    found = match_scan(prior, T_last_now, true, stop);
    if (difference(found.T_target_source, T_last_now).cwiseAbs().maxCoeff() < kStartAgrees)
      break;
  }
  first_ = {};
  map_.clear();
  map_.insert(last_scan_, T_odom_last_);
}

Registration Odometry::match_submap(const MotionPrior& prior, const Pose& T_last_now, const Gicp::StopRequested& stop) {
  const StageScope scope(clock_, Stage::scan_to_submap);
  const Pose T_start = T_odom_last_ * T_last_now;
  Registration none;
  none.T_target_source = T_start;
  if (scan_.size() < kMinPoints)
    return none;
  const PosePrior pose_prior{T_odom_last_ * prior.T_last_now, uncertainty_.against_submap().inverse()};
  const bool wide = variance_against_submap().head<3>().maxCoeff() > kWide_m * kWide_m;
  return gicp_.align(registered(), map_, T_start, pose_prior, options_.scan_to_submap, wide, stop);
}

/// What is known before the sweep is compared with the submap.
void Odometry::predict(const MotionPrior& prior) {
  uncertainty_.predict(T_odom_last_.rotation * prior.T_last_now.translation, covariance_of(prior),
                       turn_both(T_odom_last_.rotation).cwiseAbs() * prior.bias);
}

/// Of a prior, odom axes.
Matrix6 Odometry::covariance_of(const MotionPrior& prior) const {
  const Matrix6 R = turn_both(T_odom_last_.rotation);
  return R * prior.variance.asDiagonal() * R.transpose();
}

/// Of the prediction, along the axes of the base at the last sweep.
Vector6 Odometry::variance_against_submap() const {
  const Matrix6 R = turn_both(T_odom_last_.rotation);
  return (R.transpose() * uncertainty_.against_submap() * R).diagonal();
}

Pose Odometry::flatten(const Pose& T_last_now, const Matrix6& information_odom) const {
  if (!flat_ground_.holds())
    return T_last_now;
  return T_odom_last_.inverse() * flat_ground_.flatten(T_odom_last_, T_odom_last_ * T_last_now, information_odom);
}

bool Odometry::trusts(const Registration& registration, const Pose& T_last_now, const Pose& T_last_predicted,
                      const Vector6& variance) const {
  if (registration.iterations == 0 || !T_last_now.finite() || share_of_inliers(registration) < kMinInlierShare)
    return false;
  Vector6 allowed;
  allowed << Eigen::Vector3d::Constant(kAlwaysAllowed_m), Eigen::Vector3d::Constant(kAlwaysAllowed_rad);
  allowed = allowed.cwiseMax(kMaxDeviation_sigma * variance.cwiseSqrt());
  return (difference(T_last_now, T_last_predicted).cwiseAbs().array() <= allowed.array()).all();
}

/// Whether the motion sources know better than what is left of the correspondences. After a time without lidar they do
/// not.
bool Odometry::is_outvoted(const Sweep& sweep, const Registration& registration, const Pose& T_last_now,
                           const MotionPrior& prior) const {
  if (!prior.source.translation || !had_sight(sweep) || !misses_most(registration))
    return false;
  const Vector6 deviation = difference(T_last_now, prior.T_last_now).cwiseAbs();
  return (deviation.array() > kLoneDeviation_sigma * variance_against_submap().cwiseSqrt().array()).any();
}

bool Odometry::was_seen_lately(Stamp now) const { return std::chrono::abs(now - last_seen_) < kLately; }

/// Whether the last sweep says where this one may be looked for: placed, or refused in the midst of those that were.
bool Odometry::had_sight(const Sweep& sweep) const {
  return !adrift_ || (refused_in_a_row_ > 0 && was_seen_lately(sweep.end));
}

bool Odometry::misses_most(const Registration& registration) const {
  return share_of_inliers(registration) < kLeastOfUsual * usual_share_;
}

bool Odometry::is_fragment(const Sweep& sweep) const {
  return static_cast<double>(sweep.points.size()) < kFragment * usual_points_;
}

double Odometry::share_of_inliers(const Registration& registration) const {
  return static_cast<double>(registration.inliers) / static_cast<double>(registered_);
}

/// A sweep that the map is to take in.
void Odometry::choose_keyframe(OdometryEstimate& estimate) {
  const Pose T_keyframe_base = T_odom_keyframe_.inverse() * estimate.T_odom_base;
  const double turned_deg = angle_rad(T_keyframe_base.rotation) / kRadPerDeg;
  const bool moved =
      T_keyframe_base.translation.norm() > options_.map.keyframe_m || turned_deg > options_.map.keyframe_deg;
  const bool takes_in = !estimate.failed && (processed_ == 0 || (moved && !misses_most(estimate.scan_to_submap)));
  const bool carried = estimate.prior.translation && was_seen_lately(estimate.stamp) && !is_map_in_doubt();
  const bool restarts = refused_in_a_row_ >= kRefusalsToRestart && !carried && scan_.size() >= kMinPoints;
  if (!takes_in && !restarts)
    return;
  if (restarts && is_map_in_doubt()) {
    map_.clear();
    fitted_ = 1;
  }
  estimate.T_odom_base.rotation =
      (so3_exp(tilt_keeper_.take_correction_rad()) * estimate.T_odom_base.rotation).normalized();
  keyframe_observability_ = estimate.scan_to_submap.observability;
  T_odom_keyframe_ = estimate.T_odom_base;
  refused_in_a_row_ = 0;
  estimate.keyframe = true;
}

/// Whether as many sweeps contradict the map as ever fitted: it was begun wrong, and there is nothing in it to go on
/// from. What the service left behind has been confirmed.
bool Odometry::is_map_in_doubt() const { return !resumed_ && refused_in_a_row_ >= fitted_; }

/// Of what sweeps to come are laid against, the part that a sweep makes up. If a share s of it is new, then 2/s - 1
/// sweeps are in sight at a time, and a step of the mean over so many shifts it by 2s/(1 + s) of a step in the end.
/// Along axes that no surface constrains nothing old holds it back.
Matrix6 Odometry::share_of_map(double fresh, const Matrix6& observability) {
  const Matrix6 all = Matrix6::Identity();
  const Matrix6 seen = observability / SeenAxes::kWeakBelow;
  const Matrix6 unseen = (seen * seen + all).inverse();
  const double share = 2.0 * fresh / (1.0 + fresh);
  return share * all + (1.0 - share) * unseen;
}

/// Where the robot stands the estimate stays where it was.
void Odometry::hold_still(const Sweep& sweep, OdometryEstimate& estimate) {
  if (estimate.failed)
    return standstill_.lose_sight();
  const Pose& T_odom_seen = is_fragment(sweep) ? T_odom_last_ : estimate.T_odom_base;
  const std::optional<Pose> T_odom_held = standstill_.observe(sweep.end, T_odom_seen, sensors_.saw_motion(sweep));
  if (!T_odom_held)
    return;
  estimate.T_odom_base = *T_odom_held;
  estimate.state = TrackingState::standstill;
}

/// What a registered sweep says of itself, of its prior and of the motion sources.
void Odometry::settle(const Sweep& sweep, const MotionPrior& prior, OdometryEstimate& estimate) {
  const Pose T_last_now = T_odom_last_.inverse() * estimate.T_odom_base;
  const double share = share_of_inliers(estimate.scan_to_submap);
  usual_share_ = processed_ == 1 ? share : usual_share_ + (share - usual_share_) / kMemoryOfUsual_sweeps;
  const bool tells_no_velocity = adrift_ || is_fragment(sweep); // the way back to the submap is no motion of the robot
  const auto points = static_cast<double>(sweep.points.size());
  usual_points_ = processed_ == 1 ? points : usual_points_ + (points - usual_points_) / kMemoryOfUsual_sweeps;
  uncertainty_.see(estimate.scan_to_submap.information);
  observe(estimate);
  if (tells_no_velocity)
    return move_on(prior.T_last_now, uncertainty_.against_submap(), estimate);
  const Matrix6 R = turn_both(T_odom_last_.rotation.conjugate());
  feedback_.opinions = sensors_.judge(sweep, prior,
                                      {.T_last_now = T_last_now,
                                       .information = R * estimate.scan_to_submap.information * R.transpose(),
                                       .stands = estimate.state == TrackingState::standstill},
                                      seen_axes_);
  const Pose T_last_moved = motion(T_last_now, estimate.scan_to_scan.T_target_source);
  move_on(T_last_moved, uncertainty_.against_submap(), estimate);
  bend(difference(T_last_moved, prior.T_last_now));
  feedback_.twist_base = seen_axes_.part_of(twist_base_);
  feedback_.sees = seen_axes_.each();
}

/// T_last_now as far as it is a motion of the robot. Along axes that lidar hardly sees the place in the submap may be
/// off by much, and a few points may pull it far: there the motion is that from sweep to sweep.
Pose Odometry::motion(const Pose& T_last_now, const Pose& T_last_seen) const {
  const Vector6 corrected = seen_axes_.part_of(difference(T_last_now, T_last_seen));
  return {so3_exp(corrected.tail<3>()) * T_last_seen.rotation, T_last_seen.translation + corrected.head<3>()};
}

/// A sweep that was corrected for another motion than the robot's is bent, and lies askew. A robot that shakes or whose
/// wheels slip does so for a while.
void Odometry::bend(const Vector6& surprise) {
  Vector6 bent = surprise.cwiseAbs();
  bent.head<3>().array() += kArm_m * surprise.tail<3>().norm();
  askew_variance_ = (kAskew * bent).cwiseAbs2().cwiseMax(kShakesOn * askew_variance_);
  const Matrix6 R = turn_both(T_odom_last_.rotation);
  uncertainty_.predict(Eigen::Vector3d::Zero(), R * askew_variance_.asDiagonal() * R.transpose(), Vector6::Zero());
}

/// Which axes of the base the lidar sees, and whether they are enough.
void Odometry::observe(OdometryEstimate& estimate) {
  const Matrix6 R = turn_both(estimate.T_odom_base.rotation);
  estimate.observability = seen_axes_.observe(R.transpose() * estimate.scan_to_submap.observability * R);
  if (!seen_axes_.all() && estimate.state == TrackingState::tracking)
    estimate.state = TrackingState::degenerate;
}

/// The twist that T_last_now means, with its covariance.
void Odometry::move_on(const Pose& T_last_now, const Matrix6& covariance_odom, OdometryEstimate& estimate) {
  const double elapsed_s = to_seconds(estimate.stamp - sensors_.last_stamp());
  if (elapsed_s > 0.0) {
    twist_base_ = se3_log(T_last_now) / elapsed_s;
    const Matrix6 R = turn_both(estimate.T_odom_base.rotation.conjugate());
    estimate.twist_covariance = 2.0 / (elapsed_s * elapsed_s) * R * covariance_odom * R.transpose();
  }
  estimate.twist_base = twist_base_;
}

/// Fills in what the estimate says beside its pose, and remembers the sweep as the last.
void Odometry::finish(const Sweep& sweep, const MotionPrior& prior, OdometryEstimate& estimate) {
  estimate.stamp = sweep.end;
  estimate.points = registered_;
  estimate.prior = prior.source;
  if (!estimate.failed)
    refused_in_a_row_ = 0;
  else if (scan_.size() >= kMinPoints)
    ++refused_in_a_row_;
  feedback_ = {
      .from = sensors_.last_stamp(), .to = sweep.end, .opinions = {}, .twist_base = Vector6::Zero(), .sees = {}};
  if (estimate.failed)
    estimate.state = TrackingState::dead_reckoning;
  if (processed_ > 0 && estimate.failed) {
    sensors_.judge_blind(sweep);
    move_on(T_odom_last_.inverse() * estimate.T_odom_base, covariance_of(prior), estimate);
  } else if (processed_ > 0) {
    settle(sweep, prior, estimate);
  }
  estimate.pose_covariance = uncertainty_.since_start();
  adrift_ = estimate.failed;
  if (!estimate.failed) {
    last_seen_ = sweep.end;
    ++fitted_;
  }
  tilt_keeper_.observe(estimate.T_odom_base.rotation, gravity_.up_base());

  choose_keyframe(estimate);
  ++processed_;
  T_odom_last_ = estimate.T_odom_base;
  sensors_.remember(sweep);
  std::swap(last_scan_, scan_);
  last_registered_ = registered_;
  last_scan_mapped_ = false;
}

} // namespace locus
