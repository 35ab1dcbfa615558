// SPDX-License-Identifier: Apache-2.0
#include "core/odometry/motion_filter.hpp"

#include <Eigen/Eigenvalues>
#include <Eigen/LU>

#include <algorithm>
#include <cmath>
#include <span>

#include "core/sources/motion_sample.hpp"

namespace locus {

namespace {

/// Offsets of the parts of the state.
enum : int {
  kPosition = 0,
  kTurn = 3,
  kVelocity = 6,
  kRate = 9,
  kAccelerometer = 12,
  kGravity = 15,
  kLever = 18,
  kMap = 21,
  kOfSources = MotionFilter::kCommonStates
};

constexpr double square(double x) { return x * x; }
Vector6 squares(double translation, double rotation) {
  return (Vector6() << Eigen::Vector3d::Constant(square(translation)), Eigen::Vector3d::Constant(square(rotation)))
      .finished();
}

/// Decay time constants of the twist. Lateral, vertical, roll and pitch rates decay fast. Forward speed and yaw rate
/// persist for kPersists_s after the last measurement.
const Vector6 kFades_s = (Vector6() << 0.6, 0.3, 0.3, 0.3, 0.3, 0.6).finished();
constexpr double kPersists_s = 1.0;
constexpr double kObservedRatio = 0.5; ///< an axis is observed if an update lowers its variance below this fraction

/// Process noise: variance of the twist after one second, as squares of standard deviations in m/s and rad/s.
const Vector6 kProcess = squares(0.7, 0.7);
constexpr double kAngularAcceleration_radps2 = 20.0; ///< standard deviation of the angular acceleration
constexpr double kKnownSpeed = 0.5; ///< sigma of a speed, as a fraction of the limit, that halves its excess

/// Prior and least noise of the sources: variance of position (m) and rotation (rad) after one second.
const Vector6 kOdometryNoise = squares(0.02, 0.01), kLeastOdometryNoise = squares(0.006, 0.001);
const Vector6 kGyroNoise = squares(1.0, 0.006), kLeastGyroNoise = squares(1.0, 0.001);
constexpr double kForceNoise = square(0.02); ///< velocity variance after one second of specific force

/// Errors other than white noise: proportional ones, and those of late stamps while the motion changes.
constexpr double kProportion = 0.01;
constexpr double kLever_m = 0.1;      ///< position error of a sensor, or of the point that it reports
constexpr double kLeverFlex_m = 0.02; ///< flexing of the accelerometer's lever arm: no robot is rigid
constexpr double kLateOdometry_s = 0.02, kLateGyro_s = 0.003;

/// Prior standard deviations of the slow states, and their random walk per square root of a second.
constexpr double kAccelerometerBias = 0.1, kAccelerometerWalk = 0.002;
constexpr double kGravityError = 0.2, kGravityWalk = 0.001;
constexpr double kGyroBias = 0.02, kGyroWalk = 1e-4;
constexpr double kScale = 0.02, kScaleWalk = 3e-4;
constexpr double kDirection_rad = 0.01;                       ///< misalignment of an odometry's forward axis
constexpr double kSlip_mps = 0.003, kSlipLasts_s = 1.0;       ///< forward slip of an odometry
constexpr double kLate_s = 0.015, kLateWalk = 1e-5;           ///< lateness of a gyro's stamps
constexpr double kMounting_rad = 0.015, kMountingWalk = 1e-5; ///< deviation of a gyro's mounting from the configuration

/// A rotation within this many standard deviations of a gyro's noise carries no information on its lateness or
/// mounting.
constexpr double kPlain_sigma = 2.0;

/// Student's t, because wheels slip and visual odometry jumps more often than a Gaussian allows. An outlier of the
/// forward speed either lasts one sweep or starts a slip, which is one error for as long as it lasts.
constexpr double kDegreesOfFreedom = 4.0;
constexpr double kSlips_per_s = 0.1; ///< rate at which slips begin: prior odds against the likelihood of no slip

/// Standard deviation of the yaw at the end of a sweep within which a turn began: the rate, which is modelled as
/// constant, changed by some 2 rad/s halfway through.
constexpr double kTurned_rad = 0.1;

constexpr double kLearns_s = 5.0;      ///< time constant of the learned noise
constexpr double kPriorWeight_s = 0.5; ///< weight of the prior noise, as a duration
constexpr double kMostSigmas = 3.0;    ///< innovations are clipped here before the noise is learned from them

/// Prior variance of the lidar extrinsics (5 mm, 2 mrad). Considered, not estimated.
const Vector6 kMountingOfLidar = squares(0.005, 0.002);

const Vector6 kFirst = squares(0.003, 3e-4); ///< alignment variance of the first sweep of the map
const Vector6 kFloor = squares(0.001, 1e-4); ///< least pose variance against the submap: surfaces are known no better

/// Returns the number of calibration states of a source: three biases, the lateness and three mounting angles of a
/// gyro, or two scales and two directions of an odometry.
int states_of(SourceKind kind) { return kind == SourceKind::imu ? 7 : 4; }

/// Returns the random walk of these states per square root of a second.
LearnedSource::States walk_of(SourceKind kind) {
  if (kind == SourceKind::imu)
    return {kGyroWalk, kGyroWalk, kGyroWalk, kLateWalk, kMountingWalk, kMountingWalk, kMountingWalk};
  return {kScaleWalk, kScaleWalk, kScaleWalk, kScaleWalk, 0.0, 0.0, 0.0};
}

Eigen::Vector3d slip(const Eigen::Vector3d& rate, const Eigen::Vector3d& velocity) { return rate.cross(velocity); }

} // namespace

LearnedSource as_configured(const MotionSourceOptions& source) {
  const CalibrationSigma& configured = source.calibration_sigma;
  LearnedSource known;
  LearnedSource::States sigma;
  if (source.kind == SourceKind::imu) {
    const double late = configured.late_ms ? 1e-3 * *configured.late_ms : kLate_s;
    const double mounting = configured.mounting_deg ? kRadPerDeg * *configured.mounting_deg : kMounting_rad;
    known.states[LearnedSource::kLate] = 1e-3 * source.late_ms;
    sigma << kGyroBias, kGyroBias, kGyroBias, late, mounting, mounting, mounting;
  } else {
    known.states.head<2>() << source.scale - 1.0, source.yaw_scale - 1.0;
    sigma << configured.scale.value_or(kScale), configured.yaw_scale.value_or(kScale), kDirection_rad, kDirection_rad,
        0, 0, 0;
  }
  known.covariance.diagonal() = sigma.cwiseAbs2();
  known.noise_per_s = source.kind == SourceKind::imu ? kGyroNoise : kOdometryNoise;
  return known;
}

Pose LearnedSource::without_scale(const Pose& way) const { return {way.rotation, way.translation / (1.0 + states[0])}; }

MotionFilter::MotionFilter(const std::vector<MotionSourceOptions>& sources, const MotionLimits& limits)
    : limits_(limits), acceleration_variance_(squares(0.5 * limits.max_acceleration_mps2, kAngularAcceleration_radps2)),
      count_(sources.size()) {
  for (std::size_t i = 0; i < count_; ++i) {
    Source& source = sources_[i];
    source.kind = sources[i].kind;
    source.lever_m = sources[i].T_base_source.translation;
    source.state = states_;
    source.states = states_of(source.kind);
    const LearnedSource known = as_configured(sources[i]);
    source.first = known.states;
    source.first_variance = known.covariance.diagonal();
    if (sources[i].calibration != Calibration::automatic) // a gyro's bias is always estimated: it is never configured
      source.first_variance
          .tail(LearnedSource::kMostStates - (source.kind == SourceKind::imu ? LearnedSource::kLate : 0))
          .setZero();
    source.fades_per_s = (source.first_variance.array() > 0.0)
                             .select(0.5 * walk_of(source.kind).cwiseAbs2().cwiseQuotient(source.first_variance), 0.0);
    states_ += source.states;
    if (source.kind == SourceKind::odometry)
      source.slip = states_++;
  }
  x_ = State::Zero(states_);
  for (const Source& source : std::span(sources_).first(count_))
    x_.segment(source.state, source.states) = source.first.head(source.states);
  P_ = Covariance::Zero(states_, states_);
  P_.diagonal().segment<3>(kAccelerometer).setConstant(square(kAccelerometerBias));
  P_.diagonal().segment<3>(kGravity).setConstant(square(kGravityError));
  P_.diagonal().segment<3>(kLever).setConstant(square(kLever_m));
  for (std::size_t i = 0; i < count_; ++i)
    reset_source(SourceId{i});
}

void MotionFilter::begin(const Pose& T_odom_base, const Vector6& twist_base, const Vector6& twist_sigma,
                         const Matrix6& map_covariance) {
  T_odom_start_ = T_odom_base_ = T_odom_base;
  twist_base_ = twist_base;
  P_.topRows<kAccelerometer>().setZero();
  P_.leftCols<kAccelerometer>().setZero();
  P_.diagonal().segment<6>(kVelocity) = twist_sigma.cwiseAbs2();
  P_.middleRows<6>(kMap).setZero();
  P_.middleCols<6>(kMap).setZero();
  P_.diagonal().head<6>() = kFloor;
  P_.block<6, 6>(kMap, kMap) = map_covariance;
  P_.diagonal().segment<6>(kMap) += kFirst;
  elapsed_s_ = 0.0;
}

void MotionFilter::reset_source(SourceId source) {
  Source& of = sources_[index_of(source)];
  const bool gyro = of.kind == SourceKind::imu;
  P_.middleRows(of.state, of.states).setZero();
  P_.middleCols(of.state, of.states).setZero();
  P_.diagonal().segment(of.state, of.states) = of.first_variance.head(of.states);
  if (of.slip)
    wander(*of.slip, 0.0, square(kSlip_mps), 0.0);
  const int changed = gyro ? LearnedSource::kLate : of.states; // lateness and mounting of a gyro keep their values
  x_.segment(of.state, changed) = of.first.head(changed);
  of.noise_per_s = gyro ? kGyroNoise : kOdometryNoise;
  of.learned_s.setZero();
  of.last_twist.reset();
}

void MotionFilter::recall(SourceId source, const LearnedSource& learned, double elapsed_s) {
  reset_source(source);
  Source& of = sources_[index_of(source)];
  of.noise_per_s = learned.noise_per_s;
  for (int i = 0; i < of.states; ++i) {
    if (of.first_variance[i] == 0.0)
      continue; // configured as exact
    x_[of.state + i] = learned.states[i];
    for (int j = 0; j < of.states; ++j)
      P_(of.state + i, of.state + j) = of.first_variance[j] == 0.0 ? 0.0 : learned.covariance(i, j);
  }
  age(of, elapsed_s);
}

/// Relaxes the calibration of a source towards its prior, so it is never less certain than the configuration.
void MotionFilter::age(const Source& source, double elapsed_s) {
  for (int i = 0; i < source.states; ++i)
    wander(source.state + i, source.first[i], source.first_variance[i], std::exp(-source.fades_per_s[i] * elapsed_s));
  if (source.slip)
    wander(*source.slip, 0.0, square(kSlip_mps), std::exp(-elapsed_s / kSlipLasts_s));
}

/// Propagates a state that reverts to a mean (Ornstein-Uhlenbeck process); `retained` is the factor by which its
/// deviation decays.
void MotionFilter::wander(int state, double mean, double variance, double retained) {
  x_[state] = mean + retained * (x_[state] - mean);
  P_.row(state) *= retained;
  P_.col(state) *= retained;
  P_(state, state) += (1.0 - square(retained)) * variance;
}

LearnedSource MotionFilter::learned(SourceId source) const {
  const Source& of = sources_[index_of(source)];
  LearnedSource learned{.noise_per_s = of.noise_per_s};
  learned.states.head(of.states) = x_.segment(of.state, of.states);
  learned.covariance.topLeftCorner(of.states, of.states) = P_.block(of.state, of.state, of.states, of.states);
  return learned;
}

void MotionFilter::predict(double elapsed_s, double period_s, const std::optional<SpecificForce>& force,
                           Measured measured, const std::optional<Eigen::Vector3d>& sensed_rate) {
  const double step_s = elapsed_s_ > 0.0 ? 0.5 * (elapsed_s + elapsed_s_) : elapsed_s; // between sweep centres
  const double unmeasured_s = std::max(0.0, std::max(step_s, elapsed_s) - period_s);
  TwistStep step = decay(elapsed_s, step_s, unmeasured_s, force.has_value(), measured);
  if (force)
    integrate(*force, std::min(step_s, period_s), sensed_rate.value_or(step.mean.tail<3>()), step);
  propagate(step.F);
  P_.diagonal().segment<6>(kVelocity) += step.variance;
  propagate(step.of_new_rate);
  if (force)
    couple_lateness(*force);
  last_force_ = force;
  P_.diagonal().segment<3>(kAccelerometer).array() += square(kAccelerometerWalk) * elapsed_s;
  P_.diagonal().segment<3>(kGravity).array() += square(kGravityWalk) * elapsed_s;
  for (Source& source : std::span(sources_).first(count_)) {
    age(source, elapsed_s);
    source.used = false;
  }
  twist_base_ = step.mean;
  predicted_variance_ = P_.diagonal().segment<6>(kVelocity);
  elapsed_s_ = elapsed_s;
}

/// Predicts the twist without specific force: axes that no source measures decay to rest. With specific force the
/// velocity decays only over the time that the force does not cover.
MotionFilter::TwistStep MotionFilter::decay(double elapsed_s, double step_s, double unmeasured_s, bool force_measured,
                                            Measured measured) {
  TwistStep step;
  for (int axis = 0; axis < 6; ++axis) {
    const bool integrated = axis < 3 && force_measured;
    const double decays_s = integrated ? unmeasured_s : step_s;
    const bool open = integrated || (axis < 3 ? measured.translation : measured.rotation);
    const bool lasts = axis == 0 || axis == 5;
    const int row = kVelocity + axis;
    const bool observed = P_(row, row) < kObservedRatio * predicted_variance_[axis];
    unobserved_s_[axis] = observed ? 0.0 : unobserved_s_[axis] + elapsed_s;
    const bool persists = (open && !integrated) || (lasts && unobserved_s_[axis] < kPersists_s);
    const double retained = persists ? 1.0 : std::exp(-decays_s / kFades_s[axis]);
    step.mean[axis] = retained * twist_base_[axis];
    step.variance[axis] = open ? acceleration_variance_[axis] * square(decays_s)
                               : kProcess[axis] * decays_s + square(twist_base_[axis]) * retained * (1.0 - retained);
    step.F(row, row) = lasts ? 1.0 : retained; // the mean decays, the standard deviation does not
  }
  return step;
}

/// Integrates the specific force. Late stamps and a lever arm are states, not noise, because their effects on the
/// velocity telescope.
void MotionFilter::integrate(const SpecificForce& force, double measured_s, const Eigen::Vector3d& new_rate,
                             TwistStep& step) const {
  const Source& source = sources_[index_of(force.source)];
  const Eigen::Vector3d velocity = twist_base_.head<3>(), rate = twist_base_.tail<3>();
  const Eigen::Vector3d rate_change = step.mean.tail<3>() - rate, mean_rate = rate + 0.5 * rate_change;
  const Eigen::Vector3d lever_m = source.lever_m + x_.segment<3>(kLever);
  const Eigen::Matrix3d R_base_odom = T_odom_base_.R().transpose();
  const Eigen::Vector3d up = Eigen::Vector3d{0.0, 0.0, kGravity_mps2} + x_.segment<3>(kGravity);
  const Eigen::Vector3d last = last_force_ ? last_force_->late_base_mps2 : force.early_base_mps2;
  const Eigen::Vector3d acceleration = 0.5 * (last + force.early_base_mps2) - x_.segment<3>(kAccelerometer) -
                                       R_base_odom * up - slip(mean_rate, velocity) -
                                       slip(mean_rate, slip(mean_rate, lever_m)); // m/s^2, base axes
  const Eigen::Vector3d change = force_change(force);
  const double late_s = x_[source.state + LearnedSource::kLate] - to_seconds(force.late);
  step.mean.head<3>() += measured_s * acceleration + late_s * change - rate_change.cross(lever_m);
  step.variance.head<3>() +=
      measured_s * (force.noise_per_s.array() + kForceNoise).matrix() + square(kLateGyro_s) * change.cwiseAbs2();
  step.variance.head<3>().array() += square(kLeverFlex_m) * (new_rate - rate).squaredNorm();
  const Eigen::Matrix3d of_rate = 0.5 * measured_s * skew(velocity), of_rate_change = skew(lever_m);
  step.F.block<3, 3>(kVelocity, kTurn) = -measured_s * R_base_odom * skew(up);
  step.F.block<3, 3>(kVelocity, kVelocity) -= measured_s * skew(mean_rate);
  step.F.block<3, 3>(kVelocity, kRate) = of_rate - of_rate_change;
  step.of_new_rate.block<3, 3>(kVelocity, kRate) = of_rate + of_rate_change;
  step.F.block<3, 3>(kVelocity, kAccelerometer).diagonal().setConstant(-measured_s);
  step.F.block<3, 3>(kVelocity, kGravity) = -measured_s * R_base_odom;
  step.F.block<3, 3>(kVelocity, kLever) = -skew(new_rate - rate) - measured_s * skew(mean_rate) * skew(mean_rate);
}

/// Returns the change of the mean specific force between the last two sweeps (m/s^2, base axes).
Eigen::Vector3d MotionFilter::force_change(const SpecificForce& force) const {
  return force.mean_base_mps2() - last_force_.value_or(force).mean_base_mps2();
}

/// Couples the velocity with the lateness: the velocity error is the lateness times the change of the specific force.
void MotionFilter::couple_lateness(const SpecificForce& force) {
  const int late = sources_[index_of(force.source)].state + LearnedSource::kLate;
  const Eigen::Vector3d change = force_change(force);
  P_.middleRows<3>(kVelocity) += (change * P_.row(late)).eval();
  P_.middleCols<3>(kVelocity) += (P_.col(late) * change.transpose()).eval();
}

void MotionFilter::expect_turn(double change_radps, double sigma_radps) {
  constexpr int kYawRate = kRate + 2;
  twist_base_[5] += change_radps;
  P_.row(kYawRate).setZero();
  P_.col(kYawRate).setZero();
  P_(kYawRate, kYawRate) = square(sigma_radps);
  const Eigen::Vector3d up_odom = T_odom_base_.R().col(2);
  P_.block<3, 3>(kTurn, kTurn) += square(kTurned_rad) * up_odom * up_odom.transpose();
}

void MotionFilter::expect_rest() {
  P_.diagonal().segment<6>(kVelocity) += twist_base_.cwiseAbs2();
  twist_base_.setZero();
}

/// Shrinks a predicted speed above the limit in proportion to its variance, and adds the reduction to the covariance,
/// so registration may exceed the limit.
void MotionFilter::limit_speed() {
  const double speed_mps = twist_base_.head<3>().norm();
  const double excess_mps = speed_mps - limits_.max_speed_mps;
  if (excess_mps <= 0.0)
    return;
  const Eigen::Vector3d ahead = twist_base_.head<3>() / speed_mps;
  const double variance = ahead.dot(P_.block<3, 3>(kVelocity, kVelocity) * ahead);
  const Eigen::Vector3d reduction =
      variance / (variance + square(kKnownSpeed * limits_.max_speed_mps)) * excess_mps * ahead;
  twist_base_.head<3>() -= reduction;
  P_.block<3, 3>(kVelocity, kVelocity) += reduction * reduction.transpose();
}

void MotionFilter::move() {
  limit_speed();
  const Pose T_odom_last = T_odom_base_;
  T_odom_base_ = T_odom_last * se3_exp(elapsed_s_ * twist_base_);
  Common F = Common::Identity();
  F.topLeftCorner<6, 6>() = transport(T_odom_base_.translation - T_odom_last.translation);
  F.block<6, 6>(kMap, kMap) = F.topLeftCorner<6, 6>();
  const Matrix6 R = turn_both(T_odom_last.rotation * so3_exp(0.5 * elapsed_s_ * twist_base_.tail<3>()));
  F.block<6, 6>(kPosition, kVelocity) = elapsed_s_ * R;
  F.block<3, 3>(kPosition, kRate) = -0.5 * square(elapsed_s_) * R.topLeftCorner<3, 3>() * skew(twist_base_.head<3>());
  // Second-order position variance from turn-rate and speed uncertainty.
  const double rate = P_.diagonal().segment<3>(kRate).maxCoeff(),
               speed = P_.diagonal().segment<3>(kVelocity).maxCoeff();
  const double second_order =
      0.5 * square(square(elapsed_s_) * elapsed_s_ / 3.0 * rate) * twist_base_.head<3>().squaredNorm() +
      square(0.5 * square(elapsed_s_)) * rate * speed;
  propagate(F);
  P_.diagonal().segment<3>(kPosition).array() += second_order;
}

/// Propagates the covariance of the common states, and their covariance with those of the sources, which do not change.
void MotionFilter::propagate(const Common& F) {
  const int own = states_ - kCommonStates;
  P_.topLeftCorner<kCommonStates, kCommonStates>() =
      (F * P_.topLeftCorner<kCommonStates, kCommonStates>() * F.transpose()).eval();
  P_.topRightCorner(kCommonStates, own) = (F * P_.topRightCorner(kCommonStates, own)).eval();
  P_.bottomLeftCorner(own, kCommonStates) = P_.topRightCorner(kCommonStates, own).transpose();
}

/// Returns Jacobian and expected value of a source's reading of one axis of the twist. An odometry scales the twist,
/// adds its slip to the forward speed, and leaks that speed into the other two axes. A gyro adds its bias, the effect
/// of its lateness (rate change times lateness), and cross-axis terms of its mounting.
MotionFilter::Row MotionFilter::row(const Source& source, const SensedTwist& sensed, int axis) const {
  Row row{State::Zero(states_), twist_base_[axis]};
  row.h[kVelocity + axis] = 1.0;
  if (source.kind == SourceKind::imu) {
    const int bias = source.state + axis - 3, late = source.state + LearnedSource::kLate,
              mounting = source.state + LearnedSource::kMounting;
    const double change = sensed.change_per_s[axis], noise = square(kPlain_sigma) * source.noise_per_s[axis];
    const Eigen::Vector3d rate = sensed.mean.tail<3>();
    row.h[bias] = 1.0;
    if (square(change) > 2.0 * noise / (to_seconds(SourcePose::kMoment) * square(elapsed_s_)))
      row.h[late] = -change;
    if (rate.squaredNorm() > noise / elapsed_s_)
      row.h.segment<3>(mounting) = skew(rate).row(axis - 3);
    row.expected += sensed.brought_forward[axis];
    row.expected += x_[bias] - x_[late] * change + rate.cross(x_.segment<3>(mounting))[axis - 3];
  } else if (axis == 0 || axis == 5) {
    const int scale = source.state + (axis == 0 ? 0 : 1);
    row.h[kVelocity + axis] += x_[scale];
    row.h[scale] = twist_base_[axis];
    row.expected += x_[scale] * twist_base_[axis];
    if (axis == 0) {
      row.h[*source.slip] = 1.0;
      row.expected += x_[*source.slip];
    }
  } else if (axis < 3) {
    const int turned = source.state + 1 + axis;
    row.h[turned] = twist_base_[0];
    row.h[kVelocity] += x_[turned];
    row.expected += x_[turned] * twist_base_[0];
  }
  return row;
}

Vector6 MotionFilter::known_variance(const Source& source, const Vector6& twist_base) const {
  const double late_s = source.kind == SourceKind::imu ? kLateGyro_s : kLateOdometry_s;
  const Vector6 limit = elapsed_s_ * acceleration_variance_.cwiseSqrt(); // limit on the change of motion
  const Vector6 change = (twist_base - source.last_twist.value_or(twist_base)).cwiseMin(limit).cwiseMax(-limit);
  Vector6 variance = (kProportion * twist_base).cwiseAbs2() + (late_s / elapsed_s_ * change).cwiseAbs2();
  variance.head<3>().array() += square(kLever_m) * twist_base.tail<3>().squaredNorm();
  return variance;
}

void MotionFilter::measure(SourceId id, const SensedTwist& sensed, Measured what) {
  Source& source = sources_[index_of(id)];
  const Vector6& twist_base = sensed.mean;
  source.known_variance = known_variance(source, twist_base);
  source.sensed = sensed;
  source.variance.setZero();
  source.used = true;
  if (what.slips && source.slip) // wheels may spin on the spot, or be blocked while the robot slides
    P_(*source.slip, *source.slip) += square(std::max(std::abs(twist_base[0]), std::abs(twist_base_[0])));
  for (int axis = what.translation ? 0 : 3; axis < (what.rotation ? 6 : 3); ++axis) {
    const auto [h, expected] = row(source, sensed, axis);
    double variance = source.noise_per_s[axis] / elapsed_s_ + source.known_variance[axis];
    const double surprise = twist_base[axis] - expected;
    const double ratio = square(surprise) / (variance + h.dot(P_ * h));
    const double peak = variance * std::max(0.0, (ratio - 1.0) / (kDegreesOfFreedom + 1.0));
    if (axis == 0 && source.slip) {
      double& slip = P_(*source.slip, *source.slip);
      const double begins = 1.0 / (1.0 + std::exp(0.5 * (odds_against_slip() - ratio)));
      slip += begins * peak;
      variance += (1.0 - begins) * peak;
      source.variance[axis] = variance + slip;
    } else {
      variance += peak;
      source.variance[axis] = variance;
    }
    const double before = twist_base_[axis];
    update_scalar(h, surprise, variance);
    if (source.kind == SourceKind::odometry && (axis == 0 || axis == 5))
      turn_scale(source.state + (axis == 0 ? 0 : 1), axis, twist_base_[axis] - before);
  }
}

/// Re-linearises the covariance of a scale and the twist after the twist has changed. A source cannot separate the two;
/// along the old direction its next reading would seem to.
void MotionFilter::turn_scale(int scale, int axis, double change) {
  const double turned = -change / (1.0 + x_[scale]);
  P_.row(kVelocity + axis) += turned * P_.row(scale);
  P_.col(kVelocity + axis) += turned * P_.col(scale);
}

void MotionFilter::rest() {
  const Vector6 sigma2 = squares(1e-3, 1e-4);
  for (int axis = 0; axis < 6; ++axis) {
    State h = State::Zero(states_);
    h[kVelocity + axis] = 1.0;
    update_scalar(h, -twist_base_[axis], sigma2[axis]);
  }
}

/// Applies a scalar measurement. Lateness and mounting of gyros are considered, not corrected: only lidar makes them
/// observable.
void MotionFilter::update_scalar(const State& h, double innovation, double variance) {
  const State Ph = P_ * h;
  const double innovation_variance = h.dot(Ph) + variance;
  State considered = of_map(Ph);
  for (const Source& source : std::span(sources_).first(count_))
    if (source.kind == SourceKind::imu)
      considered.segment<4>(source.state + LearnedSource::kLate) = Ph.segment<4>(source.state + LearnedSource::kLate);
  lower(Ph, considered, innovation_variance);
  correct((Ph - considered) / innovation_variance * innovation);
}

MotionFilter::State MotionFilter::of_map(const State& Ph) {
  State map = State::Zero(Ph.size());
  map.segment<6>(kMap) = Ph.segment<6>(kMap);
  return map;
}

/// Lowers the covariance after a measurement. The considered part of Ph (Schmidt), always including the error of the
/// map, stays as uncertain as it was.
void MotionFilter::lower(const State& Ph, const State& considered, double innovation_variance) {
  P_ -= (Ph * Ph.transpose() - considered * considered.transpose()) / innovation_variance;
  P_ = (0.5 * (P_ + P_.transpose())).eval();
}

void MotionFilter::correct(const State& error) {
  T_odom_base_ = {(so3_exp(error.segment<3>(kTurn)) * T_odom_base_.rotation).normalized(),
                  T_odom_base_.translation + error.segment<3>(kPosition)};
  twist_base_ += error.segment<6>(kVelocity);
  x_.tail(states_ - kAccelerometer) += error.tail(states_ - kAccelerometer);
  x_.segment<6>(kMap).setZero();
}

MotionBelief MotionFilter::belief() const { return {T_odom_base_, twist_base_, covariance().inverse()}; }

namespace {

/// Returns twice the negative log likelihood of Student's t for a squared Mahalanobis distance, up to a constant. The
/// pose follows from the twist, so there are six degrees of freedom.
double student_cost(double distance) {
  constexpr double kAxes = 6.0;
  return (kDegreesOfFreedom + kAxes) * std::log(1.0 + std::max(0.0, distance) / kDegreesOfFreedom);
}

} // namespace

double MotionFilter::surprise(const Registration& found) const {
  const Matrix12 P = covariance();
  Vector12 moved;
  moved << difference(found.T_target_source, T_odom_base_), found.twist_base - twist_base_;
  const double determined = (Matrix12::Identity() + P * found.information).determinant();
  return student_cost(moved.dot(P.ldlt().solve(moved))) + std::log(std::max(1.0, determined));
}

double MotionFilter::surprise_at_rest() const {
  const Matrix6 P = covariance().bottomRightCorner<6, 6>();
  return student_cost(twist_base_.dot(P.ldlt().solve(twist_base_)));
}

void MotionFilter::update(const Pose& T_odom_base, const Vector6& twist_base, const Matrix12& information) {
  const Matrix12 P = covariance();
  Vector12 moved;
  moved << difference(T_odom_base, T_odom_base_), twist_base - twist_base_;
  State error = P_.leftCols<12>() * P.inverse() * moved;
  error.head<12>().setZero();
  correct(error);
  // One eigenvector at a time, so that rounding in nearly unknown directions does not remain.
  const Eigen::SelfAdjointEigenSolver<Matrix12> eigen(information);
  for (int i = 0; i < 12; ++i) {
    if (eigen.eigenvalues()[i] <= 0.0)
      continue;
    const auto direction = eigen.eigenvectors().col(i);
    const State Ph = P_.leftCols<12>() * direction;
    lower(Ph, of_map(Ph), Ph.head<12>().dot(direction) + 1.0 / eigen.eigenvalues()[i]);
  }
  keep_floor();
  T_odom_base_ = T_odom_base;
  twist_base_ = twist_base;
}

void MotionFilter::keep_floor() { P_.diagonal().head<6>() = P_.diagonal().head<6>().cwiseMax(kFloor); }

Innovation MotionFilter::innovation(SourceId id, const SensedTwist& sensed, bool slip_explained) const {
  const Source& source = sources_[index_of(id)];
  const Vector6& twist_base = sensed.mean;
  const Vector6 known = source.used ? source.known_variance : known_variance(source, twist_base);
  Innovation found;
  for (int axis = source.kind == SourceKind::imu ? 3 : 0; axis < 6; ++axis) {
    auto [h, expected] = row(source, sensed, axis);
    if (axis == 0 && !slip_explained) {
      h[*source.slip] = 0.0;
      expected -= x_[*source.slip];
    }
    const double after = h.dot(P_ * h);
    const double noise = source.noise_per_s[axis] / elapsed_s_ + known[axis];
    const double error = twist_base[axis] - expected;
    const bool used = source.used && source.variance[axis] > 0.0;
    const double left = used ? std::max(1e-3, 1.0 - after / source.variance[axis]) : 1.0; // the others' information
    found.value[axis] = error / left;
    found.known[axis] = known[axis];
    found.others[axis] = after / left;
    found.variance[axis] = noise + found.others[axis];
  }
  return found;
}

double MotionFilter::odds_against_slip() const { return -2.0 * std::log(std::expm1(kSlips_per_s * elapsed_s_)); }

void MotionFilter::learn() {
  for (Source& source : std::span(sources_).first(count_))
    if (source.used)
      learn_source(source);
}

namespace {

/// Moves a variance towards the one that an innovation implies. `others`: variance of the estimate from all other
/// sources.
void learn_variance(double& variance, double& learned_s, double innovation, double known, double others, double per,
                    double elapsed_s, double least) {
  const double expected = variance * per + known;
  const double weight = square(expected / (expected + others)); // share of the innovation due to this source
  const double most = square(kMostSigmas) * (expected + others);
  const double found = (std::min(square(innovation), most) - others - known) / per;
  learned_s = std::min(learned_s + weight * elapsed_s, kLearns_s);
  variance += weight * elapsed_s / (kPriorWeight_s + learned_s) * (found - variance);
  variance = std::max(variance, least);
}

} // namespace

void MotionFilter::learn_source(Source& source) {
  const Innovation found = innovation(SourceId{static_cast<std::size_t>(&source - sources_.data())}, source.sensed);
  const Vector6& least = source.kind == SourceKind::imu ? kLeastGyroNoise : kLeastOdometryNoise;
  for (int axis = 0; axis < 6; ++axis) {
    const bool force_measured = axis < 3 && last_force_;
    const bool observed = force_measured || found.others[axis] < kObservedRatio * predicted_variance_[axis];
    if (source.variance[axis] == 0.0 || !observed)
      continue; // no reference to compare with
    learn_variance(source.noise_per_s[axis], source.learned_s[axis], found.value[axis], source.known_variance[axis],
                   found.others[axis], 1.0 / elapsed_s_, elapsed_s_, least[axis]);
  }
  source.last_twist = source.sensed.mean;
}

void MotionFilter::transfer_error_to_map(const Matrix6& share) {
  Common transfer = Common::Identity();
  transfer.topLeftCorner<6, 6>() -= share;
  transfer.block<6, 6>(kMap, kPosition) = share;
  propagate(transfer);
  keep_floor();
}

Matrix6 MotionFilter::pose_covariance_since_start() const {
  const Matrix6 both = P_.block<6, 6>(kMap, kPosition);
  return P_.topLeftCorner<6, 6>() + P_.block<6, 6>(kMap, kMap) + both + both.transpose() + of_mounting();
}

/// Returns the pose covariance caused by an extrinsics error, relative to the start: error of the first pose minus that
/// of the last. Considered.
Matrix6 MotionFilter::of_mounting() const {
  const Matrix6 error =
      transport(T_odom_base_.translation - T_odom_start_.translation) * turn_both(T_odom_start_.rotation) -
      turn_both(T_odom_base_.rotation);
  return error * kMountingOfLidar.asDiagonal() * error.transpose();
}

void MotionFilter::set_pose(const Pose& T_odom_base) { T_odom_base_ = T_odom_base; }

} // namespace locus
