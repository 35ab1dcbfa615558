// SPDX-License-Identifier: Apache-2.0
// Process model of the motion filter: prediction of the twist, with the accelerometer as its input, and of the pose.
#include <algorithm>
#include <cmath>
#include <span>
#include <utility>

#include "core/odometry/motion_filter.hpp"
#include "core/odometry/motion_filter_states.hpp"

namespace locus {

using namespace motion_filter;

namespace {

/// Decay time constants of the twist. Lateral, vertical, roll and pitch rates decay fast. Forward speed and yaw rate
/// persist for kPersists_s after the last measurement.
const Vector6 kFades_s = (Vector6() << 0.6, 0.3, 0.3, 0.3, 0.3, 0.6).finished();
constexpr double kPersists_s = 1.0;

/// Process noise: variance of the twist after one second, as squares of standard deviations in m/s and rad/s.
const Vector6 kProcess = squares(0.7, 0.7);
constexpr double kForceNoise = square(0.02); ///< velocity variance after one second of specific force
constexpr double kLeverFlex_m = 0.02;        ///< flexing of the accelerometer's lever arm: no robot is rigid
constexpr double kAccelerometerWalk = 0.002; ///< random walk of its bias, m/s^2 per square root of a second
constexpr double kGravityWalk = 0.001;       ///< the same of gravity
constexpr double kKnownSpeed = 0.5;          ///< sigma of a speed, as a fraction of the limit, that halves its excess

/// Standard deviation of the yaw at the end of a sweep within which a turn began: the rate, which is modelled as
/// constant, changed by some 2 rad/s halfway through.
constexpr double kTurned_rad = 0.1;

} // namespace

/// Eq. 3 in docs/estimator.md, then the random walks and eq. 4.
void MotionFilter::predict(double elapsed_s, double period_s, const std::optional<SpecificForce>& force,
                           Measured measured, const std::optional<Eigen::Vector3d>& sensed_rate) {
  const double step_s = elapsed_s_ > 0.0 ? 0.5 * (elapsed_s + elapsed_s_) : elapsed_s; // between sweep centres
  const double unmeasured_s = std::max(0.0, std::max(step_s, elapsed_s) - period_s);
  TwistStep step = decay(elapsed_s, step_s, unmeasured_s, force.has_value(), measured);
  if (force)
    integrate(*force, std::min(step_s, period_s), sensed_rate.value_or(step.mean.tail<3>()), step);
  P_.propagate(step.F);
  P_.add_variance(kTwist, step.variance);
  P_.propagate(step.of_new_rate);
  if (force)
    couple_lateness(*force);
  last_force_ = force;
  P_.add_variance(kAccelerometer, Eigen::Vector3d::Constant(square(kAccelerometerWalk) * elapsed_s));
  P_.add_variance(kGravity, Eigen::Vector3d::Constant(square(kGravityWalk) * elapsed_s));
  for (Source& source : std::span(sources_).first(count_)) {
    age(source, elapsed_s);
    source.used = false;
  }
  last_twist_base_ = std::exchange(twist_base_, step.mean);
  predicted_variance_ = P_.variances(kTwist);
  elapsed_s_ = elapsed_s;
}

/// Eq. 1 in docs/estimator.md. Predicts the twist without specific force: axes that no source measures decay to rest.
/// With specific force the velocity decays only over the time that the force does not cover.
MotionFilter::TwistStep MotionFilter::decay(double elapsed_s, double step_s, double unmeasured_s, bool force_measured,
                                            Measured measured) {
  TwistStep step;
  for (int axis = 0; axis < 6; ++axis) {
    const bool integrated = axis < 3 && force_measured;
    const double decays_s = integrated ? unmeasured_s : step_s;
    const bool open = integrated || (axis < 3 ? measured.translation : measured.rotation);
    const bool lasts = axis == kForward || axis == kYawRate;
    const int state = kTwist.begin + axis;
    const bool observed = P_.variance(state) < kObservedRatio * predicted_variance_[axis];
    unobserved_s_[axis] = observed ? 0.0 : unobserved_s_[axis] + elapsed_s;
    const bool persists = (open && !integrated) || (lasts && unobserved_s_[axis] < kPersists_s);
    const double retained = persists ? 1.0 : std::exp(-decays_s / kFades_s[axis]);
    step.mean[axis] = retained * twist_base_[axis];
    step.variance[axis] = open ? acceleration_variance_[axis] * square(decays_s)
                               : kProcess[axis] * decays_s + square(twist_base_[axis]) * retained * (1.0 - retained);
    step.F(state, state) = lasts ? 1.0 : retained; // the mean decays, the standard deviation does not
  }
  return step;
}

/// Eq. 2 and the Jacobians of eq. 3 in docs/estimator.md. Integrates the specific force. Late stamps and a lever arm
/// are states, not noise, because their effects on the velocity telescope.
void MotionFilter::integrate(const SpecificForce& force, double measured_s, const Eigen::Vector3d& new_rate,
                             TwistStep& step) const {
  const Source& source = sources_[index_of(force.source)];
  const Eigen::Vector3d velocity = twist_base_.head<3>(), rate = twist_base_.tail<3>();
  const Eigen::Vector3d rate_change = step.mean.tail<3>() - rate, mean_rate = rate + 0.5 * rate_change;
  const Eigen::Vector3d lever_m = source.lever_m + part(x_, kLever);
  const Eigen::Matrix3d R_base_odom = T_odom_base_.R().transpose();
  const Eigen::Vector3d up = Eigen::Vector3d{0.0, 0.0, kGravity_mps2} + part(x_, kGravity);
  const Eigen::Vector3d last = last_force_ ? last_force_->late_base_mps2 : force.early_base_mps2;
  const Eigen::Vector3d acceleration = 0.5 * (last + force.early_base_mps2) - part(x_, kAccelerometer) -
                                       R_base_odom * up - mean_rate.cross(velocity) -
                                       mean_rate.cross(mean_rate.cross(lever_m)); // m/s^2, base axes
  const Eigen::Vector3d change = force_change(force);
  const double late_s = x_[source.lateness()] - to_seconds(force.late);
  step.mean.head<3>() += measured_s * acceleration + late_s * change - rate_change.cross(lever_m);
  step.variance.head<3>() +=
      measured_s * (force.noise_per_s.array() + kForceNoise).matrix() + square(kLateGyro_s) * change.cwiseAbs2();
  step.variance.head<3>().array() += square(kLeverFlex_m) * (new_rate - rate).squaredNorm();
  const Eigen::Matrix3d of_rate = 0.5 * measured_s * skew(velocity), of_rate_change = skew(lever_m);
  part(step.F, kVelocity, kTurn) = -measured_s * R_base_odom * skew(up);
  part(step.F, kVelocity, kVelocity) -= measured_s * skew(mean_rate);
  part(step.F, kVelocity, kRate) = of_rate - of_rate_change;
  part(step.of_new_rate, kVelocity, kRate) = of_rate + of_rate_change;
  part(step.F, kVelocity, kAccelerometer).diagonal().setConstant(-measured_s);
  part(step.F, kVelocity, kGravity) = -measured_s * R_base_odom;
  part(step.F, kVelocity, kLever) = -skew(new_rate - rate) - measured_s * skew(mean_rate) * skew(mean_rate);
}

/// Returns the change of the mean specific force between the last two sweeps (m/s^2, base axes).
Eigen::Vector3d MotionFilter::force_change(const SpecificForce& force) const {
  return force.mean_base_mps2() - last_force_.value_or(force).mean_base_mps2();
}

/// H of eq. 3 in docs/estimator.md. Couples the velocity with the lateness: the velocity error is the lateness times
/// the change of the specific force.
void MotionFilter::couple_lateness(const SpecificForce& force) {
  P_.couple(kVelocity, force_change(force), sources_[index_of(force.source)].lateness());
}

void MotionFilter::expect_turn(double change_radps, double sigma_radps) {
  twist_base_[kYawRate] += change_radps;
  P_.reset(kTwist.begin + kYawRate, Eigen::Matrix<double, 1, 1>{square(sigma_radps)});
  const Eigen::Vector3d up_odom = T_odom_base_.R().col(2);
  P_.add_covariance(kTurn, square(kTurned_rad) * up_odom * up_odom.transpose());
}

void MotionFilter::expect_rest() {
  P_.add_variance(kTwist, twist_base_.cwiseAbs2());
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
  const double variance = ahead.dot(P_.block(kVelocity, kVelocity) * ahead);
  const Eigen::Vector3d reduction =
      variance / (variance + square(kKnownSpeed * limits_.max_speed_mps)) * excess_mps * ahead;
  twist_base_.head<3>() -= reduction;
  P_.add_covariance(kVelocity, reduction * reduction.transpose());
}

/// Eq. 5 in docs/estimator.md. Integrates the twist, constant in base axes, to the pose.
void MotionFilter::move() {
  limit_speed();
  const Pose T_odom_last = T_odom_base_;
  T_odom_base_ = T_odom_last * se3_exp(elapsed_s_ * twist_base_);
  Common F = Common::Identity();
  part(F, kPose, kPose) = transport(T_odom_base_.translation - T_odom_last.translation);
  part(F, kMap, kMap) = part(F, kPose, kPose);
  const Matrix6 R = turn_both(T_odom_last.rotation * so3_exp(0.5 * elapsed_s_ * twist_base_.tail<3>()));
  part(F, kPose, kTwist) = elapsed_s_ * R;
  part(F, kPosition, kRate) = -0.5 * square(elapsed_s_) * R.topLeftCorner<3, 3>() * skew(twist_base_.head<3>());
  // Second-order position variance from turn-rate and speed uncertainty.
  const double rate = P_.variances(kRate).maxCoeff(), speed = P_.variances(kVelocity).maxCoeff();
  const double second_order =
      0.5 * square(square(elapsed_s_) * elapsed_s_ / 3.0 * rate) * twist_base_.head<3>().squaredNorm() +
      square(0.5 * square(elapsed_s_)) * rate * speed;
  P_.propagate(F);
  P_.add_variance(kPosition, Eigen::Vector3d::Constant(second_order));
}

} // namespace locus
