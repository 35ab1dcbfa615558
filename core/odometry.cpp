// SPDX-License-Identifier: Apache-2.0
#include "core/odometry.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "core/motion_sources.hpp"

namespace locus {

namespace {

constexpr std::size_t kMinPoints = 30; ///< fewer say nothing reliable about six axes

/// Least share of the points that must find a counterpart for a registration to be believed.
constexpr double kMinInlierShare = 0.1;

/// A registration that contradicts the prior by more than this many standard deviations, and by more than the least, is
/// refused.
constexpr double kMaxDeviation_sigma = 8.0;
constexpr double kAlwaysAllowed_m = 0.5;
constexpr double kAlwaysAllowed_rad = 0.1;

/// After so many refusals in a row the submap is behind us, and the map goes on from the prediction.
constexpr int kRefusalsToRestart = 10;

/// Neighbouring points share errors of calibration and of correction: so many of them count as one.
constexpr double kPointsPerIndependentPoint = 4.0;

/// Least share of normals along a direction for it to count as seen, with hysteresis.
constexpr double kDegenerateBelow = 0.02;
constexpr double kObservableAbove = 0.04;

constexpr double kGravity_mps2 = 9.80665;
constexpr double kGravityTolerance_mps2 = 0.5;

/// A prior that is less sure than this looks for counterparts all around each point.
constexpr double kWide_m = 0.3;

constexpr int kStartRounds = 3; ///< until motion and correction of the first two sweeps agree

/// Room for the 16 000 voxels of a large sweep, and small enough for the second cache.
constexpr std::size_t kLastScanBytes = 2'500'000;

Vector6 sigma(double translation_m, double rotation_deg) {
  const double rotation_rad = rotation_deg * std::numbers::pi / 180.0;
  Vector6 s;
  s << Eigen::Vector3d::Constant(translation_m), Eigen::Vector3d::Constant(rotation_rad);
  return s;
}

/// Per sweep, against a constant velocity: what 4 m/s^2 and 2 rad/s^2 do in 0.1 s. Standing must not teach that it
/// lasts.
const Vector6 kRobotsAccelerate = sigma(0.02, 0.5);
const Vector6 kUnknownMotion = sigma(3.0, 10.0); ///< per sweep, of a robot of which nothing is known

/// Block-diagonal matrix that turns both halves of a 6-vector.
Matrix6 turn_both(const Eigen::Quaterniond& rotation) {
  Matrix6 R = Matrix6::Zero();
  R.topLeftCorner<3, 3>() = R.bottomRightCorner<3, 3>() = rotation.toRotationMatrix();
  return R;
}

/// Difference T - reference as translation and turn, both along the axes of the common left frame.
Vector6 difference(const Pose& T, const Pose& reference) {
  Vector6 d;
  d << T.translation - reference.translation, so3_log(T.rotation * reference.rotation.conjugate());
  return d;
}

/// What a source may be off by in a sweep before lidar objects, one standard deviation. Above what a healthy one is off
/// by on bad ground, well below spinning wheels: a prior that is merely poor has its weight for that.
const Vector6 kHonestError = sigma(0.01, 0.2);

/// Chi-square test of the axes that lidar sees, which are those it knows better than an honest source does.
LidarOpinion opinion_on(const Vector6& error, const Matrix6& lidar_information) {
  constexpr double kMaxChiSquare = 38.0; ///< exceeded once in a million by six honest axes
  double chi_square = 0.0;
  bool sees = false;
  for (int axis = 0; axis < 6; ++axis) {
    const double variance = kHonestError[axis] * kHonestError[axis];
    if (lidar_information(axis, axis) * variance < 1.0)
      continue;
    sees = true;
    chi_square += error[axis] * error[axis] / (variance + 1.0 / lidar_information(axis, axis));
  }
  if (!sees)
    return LidarOpinion::none;
  return chi_square > kMaxChiSquare ? LidarOpinion::disagrees : LidarOpinion::agrees;
}

/// Takes points to the end of their sweep, for a base that moved with a constant twist while the sweep came in: exactly
/// at instants a few milliseconds apart, between them to first order.
class TwistCorrection {
 public:
  TwistCorrection(const Vector6& twist_base, double duration_s)
      : velocity_mps_(twist_base.head<3>().cast<float>()), turn_radps_(twist_base.tail<3>().cast<float>()),
        step_s_(static_cast<float>(duration_s / kInstants)) {
    for (std::size_t i = 0; i < kInstants; ++i) {
      const Pose T_end_then = se3_exp(-(static_cast<double>(i) + 0.5) * duration_s / kInstants * twist_base);
      instants_[i] = {T_end_then.R().cast<float>(), T_end_then.translation.cast<float>()};
    }
  }

  [[nodiscard]] SurfacePoint operator()(const SweepPoint& point) const {
    constexpr float kLast = kInstants - 1;
    const float i = std::clamp(std::floor(point.age_s / step_s_), 0.0F, kLast);
    const auto& [R, t] = instants_[static_cast<std::size_t>(i)];
    const float earlier_s = point.age_s - (i + 0.5F) * step_s_;
    const Eigen::Vector3f p = R * point.position_base_m + t;
    const Eigen::Vector3f n = R * point.normal_base;
    return {p - earlier_s * (turn_radps_.cross(p) + velocity_mps_), n - earlier_s * turn_radps_.cross(n)};
  }

 private:
  static constexpr std::size_t kInstants = 32;
  struct Affine {
    Eigen::Matrix3f R;
    Eigen::Vector3f t;
  };
  Eigen::Vector3f velocity_mps_, turn_radps_;
  float step_s_;
  std::array<Affine, kInstants> instants_;
};

void correct_all(std::span<const SweepPoint> points, const Vector6& twist_base, Duration duration,
                 std::vector<SurfacePoint>& scan) {
  scan.clear();
  if (twist_base.isZero() || duration <= Duration::zero()) {
    for (const SweepPoint& point : points)
      scan.push_back({point.position_base_m, point.normal_base});
    return;
  }
  const TwistCorrection corrected(twist_base, to_seconds(duration));
  for (const SweepPoint& point : points)
    scan.push_back(corrected(point));
}

} // namespace

Odometry::Odometry(const OdometryOptions& options, StageClock* clock)
    : options_(options), clock_(clock), gicp_(options.threads, options.isa), flat_ground_(options.flat_ground),
      map_(options.map.max_bytes), last_scan_map_(kLastScanBytes),
      constant_velocity_statistics_(sigma(0.3, 3.0), kRobotsAccelerate) {
  for (const MotionSourceOptions& source : options.motion_sources) {
    const bool imu = source.kind == SourceKind::imu;
    statistics_.emplace_back(imu ? sigma(0.3, 0.3) : sigma(0.05, 0.5), sigma(0.002, 0.02));
  }
}

OdometryEstimate Odometry::process(const Sweep& sweep, const Gicp::StopRequested& stop) {
  if (processed_ == 0)
    return begin(sweep);
  const Prior prior = integrate_sensors(sweep);
  flat_ground_.observe(sweep.end, sweep.specific_force_base_mps2);
  Pose T_last_now = prior.T_last_now;
  correct_motion(sweep, T_last_now);

  OdometryEstimate estimate;
  estimate.scan_to_scan = match_scan(prior, T_last_now, prior.blind, stop);
  if (trusts(estimate.scan_to_scan, estimate.scan_to_scan.T_target_source, prior.T_last_now, prior.variance)) {
    if (prior.blind)
      begin_again(sweep, prior, estimate.scan_to_scan, stop);
    T_last_now = flatten(estimate.scan_to_scan.T_target_source);
    correct_motion(sweep, T_last_now);
  }
  estimate.scan_to_submap = match_submap(prior, T_last_now, stop);
  const Pose T_last_submap = T_odom_last_.inverse() * estimate.scan_to_submap.T_target_source;
  estimate.failed = !trusts(estimate.scan_to_submap, T_last_submap, prior.T_last_now, variance_in_submap(prior));
  estimate.T_odom_base = T_odom_last_ * (estimate.failed ? T_last_now : flatten(T_last_submap));
  finish(sweep, prior, estimate);
  return estimate;
}

/// The world begins at the first sweep: at its origin, without yaw, level if gravity is known.
OdometryEstimate Odometry::begin(const Sweep& sweep) {
  const auto& force = sweep.specific_force_base_mps2;
  if (force && std::abs(force->norm() - kGravity_mps2) < kGravityTolerance_mps2)
    T_odom_last_.rotation = from_rpy_rad(level_rpy_rad(*force));
  correct_all(sweep.points, Vector6::Zero(), Duration::zero(), scan_);
  registered_ = sweep.registered;
  if (sweep.uncorrected != Uncorrected::nothing)
    first_points_ = sweep.points;
  OdometryEstimate estimate;
  estimate.T_odom_base = T_odom_last_;
  estimate.failed = scan_.size() < kMinPoints;
  finish(sweep, Prior{}, estimate);
  if (estimate.failed)
    processed_ = 0; // nothing was seen yet: the next sweep is the first
  return estimate;
}

Odometry::Prior Odometry::integrate_sensors(const Sweep& sweep) const {
  Prior prior;
  const double elapsed_s = to_seconds(sweep.end - last_stamp_);
  const double periods = last_period_ > Duration::zero() ? std::max(1.0, elapsed_s / to_seconds(last_period_)) : 1.0;
  const bool keeps_velocity = options_.no_source_prior == NoSourcePrior::constant_velocity && elapsed_s > 0.0;
  if (keeps_velocity)
    prior.T_last_now = se3_exp(elapsed_s * twist_base_);
  prior.source.rotation = prior.source.translation =
      keeps_velocity ? PriorSource::kConstantVelocity : PriorSource::kIdentity;
  prior.blind = processed_ == 1;
  prior.variance = prior.blind ? kUnknownMotion.cwiseAbs2().eval() : constant_velocity_statistics_.variance(periods);
  prior.bias = prior.variance.cwiseSqrt(); // who goes on as before errs more the longer it does

  const auto kind_of = [this](std::size_t i) { return options_.motion_sources[i].kind; };
  const auto usable = [&](std::size_t i) {
    return sweep.sources[i].usable && last_sources_[i].usable && step(sweep, i).has_value();
  };
  const SourceChoice choice = choose_sources(kind_of, options_.motion_sources.size(), options_.fusion, usable);
  if (choice.rotation) {
    prior.T_last_now.rotation = step(sweep, *choice.rotation)->rotation;
    prior.variance.tail<3>() = statistics_[*choice.rotation].variance(periods).tail<3>();
    prior.bias.tail<3>() = statistics_[*choice.rotation].bias(periods).tail<3>();
    prior.source.rotation = static_cast<int>(*choice.rotation);
  }
  if (choice.translation) {
    prior.T_last_now.translation = step(sweep, *choice.translation)->translation;
    prior.variance.head<3>() = statistics_[*choice.translation].variance(periods).head<3>();
    prior.bias.head<3>() = statistics_[*choice.translation].bias(periods).head<3>();
    prior.source.translation = static_cast<int>(*choice.translation);
    prior.blind = false;
  }
  return prior;
}

/// T_last_now as one source saw it; nothing where it does not know.
std::optional<Pose> Odometry::step(const Sweep& sweep, std::size_t source) const {
  const SourcePose& last = last_sources_[source];
  const SourcePose& now = sweep.sources[source];
  if (!last.known || !now.known || last.spell != now.spell)
    return std::nullopt;
  return last.T_source_base.inverse() * now.T_source_base;
}

/// Takes out of the points what no motion source could, with the twist that T_last_now means.
void Odometry::correct_motion(const Sweep& sweep, const Pose& T_last_now) {
  correct_all(sweep.points, uncorrected_twist(sweep, T_last_now), sweep.end - sweep.start, scan_);
  registered_ = sweep.registered;
}

/// The part of the motion that is still in the points of the sweep.
Vector6 Odometry::uncorrected_twist(const Sweep& sweep, const Pose& T_last_now) const {
  const double elapsed_s = to_seconds(sweep.end - last_stamp_);
  if (sweep.uncorrected == Uncorrected::nothing || elapsed_s <= 0.0)
    return Vector6::Zero();
  Vector6 twist = se3_log(T_last_now) / elapsed_s;
  if (sweep.uncorrected == Uncorrected::translation)
    twist.tail<3>().setZero();
  return twist;
}

Registration Odometry::match_scan(const Prior& prior, const Pose& T_start, bool wide, const Gicp::StopRequested& stop) {
  Registration none;
  none.T_target_source = T_start;
  const bool needed = options_.scan_to_scan_mode == ScanToScanMode::always || prior.source.translation < 0;
  if (options_.scan_to_scan_mode == ScanToScanMode::off || !needed || scan_.size() < kMinPoints)
    return none;
  const StageScope scope(clock_, Stage::scan_to_scan);
  last_scan_map_.clear();
  // Once the motion is roughly known, the points that are registered make map enough.
  const std::size_t points = prior.blind ? last_scan_.size() : last_registered_;
  last_scan_map_.insert(std::span(last_scan_).first(points), Pose{});
  const PosePrior pose_prior{prior.T_last_now, prior.variance.cwiseInverse().asDiagonal()};
  return gicp_.align(registered(), last_scan_map_, T_start, pose_prior, options_.scan_to_scan, wide, stop);
}

/// The first two sweeps came without any idea of the motion. What was found between them corrects both, so it can be
/// found better; then the map begins anew with the first one corrected.
void Odometry::begin_again(const Sweep& sweep, const Prior& prior, Registration& found,
                           const Gicp::StopRequested& stop) {
  if (first_points_.empty())
    return;
  for (int round = 0; round < kStartRounds; ++round) {
    const Pose T_last_now = found.T_target_source;
    correct_all(first_points_, uncorrected_twist(sweep, T_last_now), sweep.end - sweep.start, last_scan_);
    correct_motion(sweep, T_last_now);
    found = match_scan(prior, T_last_now, false, stop);
  }
  first_points_ = {};
  map_.clear();
  map_.insert(last_scan_, T_odom_last_);
}

Registration Odometry::match_submap(const Prior& prior, const Pose& T_last_now, const Gicp::StopRequested& stop) {
  const StageScope scope(clock_, Stage::scan_to_submap);
  const Pose T_start = T_odom_last_ * T_last_now;
  Registration none;
  none.T_target_source = T_start;
  if (scan_.size() < kMinPoints)
    return none;
  const Matrix6 R = turn_both(T_odom_last_.rotation);
  const Vector6 variance = variance_in_submap(prior);
  const PosePrior pose_prior{T_odom_last_ * prior.T_last_now, R * variance.cwiseInverse().asDiagonal() * R.transpose()};
  const bool wide = variance.head<3>().maxCoeff() > kWide_m * kWide_m;
  return gicp_.align(registered(), map_, T_start, pose_prior, options_.scan_to_submap, wide, stop);
}

/// Of the prior as seen from the submap, in base axes: after dead reckoning its start is in doubt as well.
Vector6 Odometry::variance_in_submap(const Prior& prior) const {
  const Matrix6 R = turn_both(T_odom_last_.rotation.conjugate());
  return prior.variance + (R.cwiseAbs() * adrift_.bias).cwiseAbs2() + R.cwiseAbs() * adrift_.variance;
}

Pose Odometry::flatten(const Pose& T_last_now) const {
  if (!flat_ground_.holds())
    return T_last_now;
  return T_odom_last_.inverse() * FlatGroundAssumption::flatten(T_odom_last_, T_odom_last_ * T_last_now);
}

bool Odometry::trusts(const Registration& registration, const Pose& T_last_now, const Pose& T_last_predicted,
                      const Vector6& variance) const {
  if (registration.iterations == 0 || !T_last_now.finite() ||
      static_cast<double>(registration.inliers) < kMinInlierShare * static_cast<double>(registered_))
    return false;
  Vector6 allowed;
  allowed << Eigen::Vector3d::Constant(kAlwaysAllowed_m), Eigen::Vector3d::Constant(kAlwaysAllowed_rad);
  allowed = allowed.cwiseMax(kMaxDeviation_sigma * variance.cwiseSqrt());
  return (difference(T_last_now, T_last_predicted).cwiseAbs().array() <= allowed.array()).all();
}

/// Compares what each source predicted, and a constant velocity if that was the prior, with what lidar found. A source
/// that is in agreement teaches its statistics; one in disagreement would only teach them to expect the worst.
void Odometry::judge_sources(const Sweep& sweep, const Prior& prior, const Pose& T_last_now,
                             const Registration& registration) {
  const Matrix6 R = turn_both(T_odom_last_.rotation.conjugate());
  const Matrix6 information = R * registration.information * R.transpose() / kPointsPerIndependentPoint;
  for (std::size_t i = 0; i < options_.motion_sources.size(); ++i) {
    const std::optional<Pose> T_last_predicted = step(sweep, i);
    if (!T_last_predicted)
      continue;
    Matrix6 seen = information;
    if (options_.motion_sources[i].kind == SourceKind::imu)
      seen.topRows<3>().setZero(); // knows nothing of translation
    const Vector6 difference_in_step = difference(T_last_now, *T_last_predicted);
    feedback_.opinions[i] = opinion_on(difference_in_step, seen);
    if (feedback_.opinions[i] != LidarOpinion::disagrees)
      statistics_[i].learn(difference_in_step, seen);
  }
  if (prior.source.translation < 0)
    constant_velocity_statistics_.learn(difference(T_last_now, prior.T_last_now), information);
}

void Odometry::update_map(OdometryEstimate& estimate) {
  const Pose T_keyframe_base = T_odom_keyframe_.inverse() * estimate.T_odom_base;
  const double turned_deg = angle_rad(T_keyframe_base.rotation) * 180.0 / std::numbers::pi;
  const bool moved =
      T_keyframe_base.translation.norm() > options_.map.keyframe_m || turned_deg > options_.map.keyframe_deg;
  const bool first = processed_ == 0;
  const bool restarts = refused_in_a_row_ >= kRefusalsToRestart && scan_.size() >= kMinPoints;
  if ((estimate.failed && !restarts) || !(moved || first || restarts))
    return;
  const StageScope scope(clock_, Stage::map);
  map_.insert(scan_, estimate.T_odom_base);
  T_odom_keyframe_ = estimate.T_odom_base;
  refused_in_a_row_ = 0;
  estimate.keyframe = true;
}

/// What a prediction says of itself. Until lidar finds the submap again its bias adds up. The noise of a step does not:
/// most of it is the lidar's own, by which it was learned, and the next step takes it back.
void Odometry::drift(const Prior& prior, OdometryEstimate& estimate) {
  const Eigen::Vector3d moved_m = estimate.T_odom_base.translation - T_odom_last_.translation;
  const Matrix6 R = turn_both(T_odom_last_.rotation);
  adrift_.bias.head<3>() += skew(moved_m).cwiseAbs() * adrift_.bias.tail<3>();
  adrift_.bias += R.cwiseAbs() * prior.bias;
  adrift_.variance = R.cwiseAbs() * prior.variance;
  carry_covariance(moved_m);
  estimate.pose_covariance = covariance_;
  estimate.pose_covariance.diagonal() += adrift_.bias.cwiseAbs2() + adrift_.variance;
  move_on(T_odom_last_.inverse() * estimate.T_odom_base, R * prior.variance.asDiagonal() * R.transpose(), estimate);
}

/// What a registered sweep says of itself, of its prior and of the motion sources.
void Odometry::settle(const Sweep& sweep, const Prior& prior, OdometryEstimate& estimate) {
  const Pose T_last_now = T_odom_last_.inverse() * estimate.T_odom_base;
  const double weakest = estimate.scan_to_submap.observability[0];
  degenerate_ = weakest < (degenerate_ ? kObservableAbove : kDegenerateBelow);
  const Matrix6 R = turn_both(T_odom_last_.rotation);
  const Matrix6 prior_information = R * variance_in_submap(prior).cwiseInverse().asDiagonal() * R.transpose();
  const Matrix6 covariance =
      (prior_information + estimate.scan_to_submap.information / kPointsPerIndependentPoint).inverse();
  carry_covariance(estimate.T_odom_base.translation - T_odom_last_.translation);
  estimate.pose_covariance = covariance_ + covariance;
  if (!adrift_.variance.isZero()) { // the way back to the submap is no motion of the robot
    adrift_ = {};
    move_on(prior.T_last_now, covariance, estimate);
    return;
  }
  judge_sources(sweep, prior, T_last_now, estimate.scan_to_submap);
  move_on(T_last_now, covariance, estimate);
  if (!degenerate_)
    feedback_.twist_base = twist_base_;
}

/// The covariance of the pose before, as one of the pose now: turns about there move what is here.
void Odometry::carry_covariance(const Eigen::Vector3d& moved_m) {
  Matrix6 transport = Matrix6::Identity();
  transport.topRightCorner<3, 3>() = -skew(moved_m);
  covariance_ = transport * covariance_ * transport.transpose();
}

/// The twist that T_last_now means, with its covariance.
void Odometry::move_on(const Pose& T_last_now, const Matrix6& covariance_odom, OdometryEstimate& estimate) {
  const double elapsed_s = to_seconds(estimate.stamp - last_stamp_);
  if (elapsed_s > 0.0) {
    twist_base_ = se3_log(T_last_now) / elapsed_s;
    const Matrix6 R = turn_both(estimate.T_odom_base.rotation.conjugate());
    estimate.twist_covariance = 2.0 / (elapsed_s * elapsed_s) * R * covariance_odom * R.transpose();
  }
  estimate.twist_base = twist_base_;
}

/// Fills in what the estimate says beside its pose, takes the sweep into the map and remembers it as the last.
void Odometry::finish(const Sweep& sweep, const Prior& prior, OdometryEstimate& estimate) {
  estimate.stamp = sweep.end;
  estimate.points = registered_;
  estimate.prior = prior.source;
  if (!estimate.failed)
    refused_in_a_row_ = 0;
  else if (scan_.size() >= kMinPoints)
    ++refused_in_a_row_;
  feedback_ = {.from = last_stamp_, .to = sweep.end, .opinions = {}, .twist_base = {}};
  if (processed_ > 0 && estimate.failed)
    drift(prior, estimate);
  else if (processed_ > 0)
    settle(sweep, prior, estimate);
  if (scan_.size() < kMinPoints || estimate.failed)
    estimate.state = TrackingState::dead_reckoning;
  else
    estimate.state = degenerate_ ? TrackingState::degenerate : TrackingState::tracking;

  update_map(estimate);
  if (estimate.keyframe) {
    covariance_ = estimate.pose_covariance;
    adrift_ = {};
  }
  ++processed_;
  T_odom_last_ = estimate.T_odom_base;
  last_stamp_ = sweep.end;
  last_period_ = sweep.end - sweep.start;
  last_sources_ = sweep.sources;
  std::swap(last_scan_, scan_);
  last_registered_ = registered_;
}

} // namespace locus
