// SPDX-License-Identifier: Apache-2.0
// Measurement models of the motion filter: the sensors other than lidar, each with its equation.
#include <algorithm>
#include <cmath>

#include "core/odometry/motion_filter.hpp"
#include "core/odometry/motion_filter_states.hpp"

namespace locus {

using namespace motion_filter;

namespace {

/// Errors other than white noise: proportional ones, and those of late stamps while the motion changes.
constexpr double kProportion = 0.01;
constexpr double kLateOdometry_s = 0.02;

/// A rotation within this many standard deviations of a gyro's noise carries no information on its lateness or
/// mounting.
constexpr double kPlain_sigma = 2.0;

constexpr double kSlips_per_s = 0.1; ///< rate at which slips begin: prior odds against the likelihood of no slip

} // namespace

/// Gyro, eq. 6 in docs/estimator.md: w_i + bias_i - lateness dw_i/dt + (w x mounting)_i, and the change by the delay
/// that has been removed. The Jacobian with respect to lateness and mounting excludes what noise explains.
MotionFilter::Row MotionFilter::gyro_row(const Source& gyro, const SensedTwist& sensed, int axis) const {
  Row row{State::Zero(states_), twist_base_[axis]};
  const int bias = gyro.state + axis - 3;
  const double change = sensed.change_per_s[axis], noise = square(kPlain_sigma) * gyro.noise_per_s[axis];
  const Eigen::Vector3d rate = sensed.mean.tail<3>();
  row.h[kTwist.begin + axis] = 1.0;
  row.h[bias] = 1.0;
  if (square(change) > 2.0 * noise / (to_seconds(SourcePose::kMoment) * square(elapsed_s_)))
    row.h[gyro.lateness()] = -change;
  if (rate.squaredNorm() > noise / elapsed_s_)
    part(row.h, gyro.mounting()) = skew(rate).row(axis - 3);
  row.expected += sensed.brought_forward[axis];
  row.expected += x_[bias] - x_[gyro.lateness()] * change + rate.cross(part(x_, gyro.mounting()))[axis - 3];
  return row;
}

/// Odometry, eq. 6 in docs/estimator.md: (1 + scale) v_x + slip, v_y + leftward v_x, v_z + upward v_x, w_x, w_y,
/// (1 + yaw scale) w_z.
MotionFilter::Row MotionFilter::odometry_row(const Source& odometry, int axis) const {
  Row row{State::Zero(states_), twist_base_[axis]};
  row.h[kTwist.begin + axis] = 1.0;
  if (axis == kForward || axis == kYawRate) {
    const int scale = odometry.scale(axis);
    row.h[kTwist.begin + axis] += x_[scale];
    row.h[scale] = twist_base_[axis];
    row.expected += x_[scale] * twist_base_[axis];
    if (axis == kForward) {
      row.h[*odometry.slip] = 1.0;
      row.expected += x_[*odometry.slip];
    }
  } else if (axis < 3) {
    const int direction = odometry.state + LearnedSource::kLeftward + axis - 1;
    row.h[direction] = twist_base_[kForward];
    row.h[kTwist.begin + kForward] += x_[direction];
    row.expected += x_[direction] * twist_base_[kForward];
  }
  return row;
}

/// Returns Jacobian and expected value of a source's reading of one axis of the twist.
MotionFilter::Row MotionFilter::row(const Source& source, const SensedTwist& sensed, int axis) const {
  return source.kind == SourceKind::imu ? gyro_row(source, sensed, axis) : odometry_row(source, axis);
}

/// Eq. 7 in docs/estimator.md, V without the learned noise.
Vector6 MotionFilter::known_variance(const Source& source, const Vector6& twist_base) const {
  const double late_s = source.kind == SourceKind::imu ? kLateGyro_s : kLateOdometry_s;
  const Vector6 limit = elapsed_s_ * acceleration_variance_.cwiseSqrt(); // limit on the change of motion
  const Vector6 change = (twist_base - source.last_twist.value_or(twist_base)).cwiseMin(limit).cwiseMax(-limit);
  Vector6 variance = (kProportion * twist_base).cwiseAbs2() + (late_s / elapsed_s_ * change).cwiseAbs2();
  variance.head<3>().array() += square(kLever_m) * twist_base.tail<3>().squaredNorm();
  return variance;
}

/// Eq. 7 in docs/estimator.md, axis by axis.
void MotionFilter::measure(SourceId id, const SensedTwist& sensed, Measured what) {
  Source& source = sources_[index_of(id)];
  const Vector6& twist_base = sensed.mean;
  source.known_variance = known_variance(source, twist_base);
  source.sensed = sensed;
  source.variance.setZero();
  source.used = true;
  if (what.slips && source.slip) // wheels may spin on the spot, or be blocked while the robot slides
    P_.add_variance(*source.slip, square(std::max(std::abs(twist_base[kForward]), std::abs(twist_base_[kForward]))));
  for (int axis = what.translation ? 0 : 3; axis < (what.rotation ? 6 : 3); ++axis) {
    const auto [h, expected] = row(source, sensed, axis);
    const double variance = source.noise_per_s[axis] / elapsed_s_ + source.known_variance[axis];
    const double innovation = twist_base[axis] - expected, before = twist_base_[axis];
    const double ratio = square(innovation) / (variance + h.dot(P_.matrix() * h));
    update_scalar(h, innovation, widen(source, axis, ratio, variance));
    if (source.kind == SourceKind::odometry && (axis == kForward || axis == kYawRate))
      relinearise_scale(source, axis, twist_base_[axis] - before);
  }
}

/// Eq. 7 in docs/estimator.md, V+. Returns the variance of a reading, widened for an outlier as Student's t demands.
/// `ratio`: normalised innovation squared. An outlier of an odometry's forward speed either lasts one sweep or starts a
/// slip, which is one error for as long as it lasts: the excess is divided between the reading and the slip by their
/// odds.
double MotionFilter::widen(Source& source, int axis, double ratio, double variance) {
  const double excess = variance * std::max(0.0, (ratio - 1.0) / (kDegreesOfFreedom + 1.0));
  if (axis != kForward || !source.slip) {
    source.variance[axis] = variance + excess;
    return source.variance[axis];
  }
  const double slip_begins = 1.0 / (1.0 + std::exp(0.5 * (odds_against_slip() - ratio)));
  P_.add_variance(*source.slip, slip_begins * excess);
  const double widened = variance + (1.0 - slip_begins) * excess;
  source.variance[axis] = widened + P_.variance(*source.slip);
  return widened;
}

/// Re-linearises the covariance of a scale and the twist after the twist has changed. A source cannot separate the two;
/// along the old direction its next reading would seem to.
void MotionFilter::relinearise_scale(const Source& odometry, int axis, double change) {
  const int scale = odometry.scale(axis);
  P_.couple(Block<1>{kTwist.begin + axis}, Eigen::Matrix<double, 1, 1>{-change / (1.0 + x_[scale])}, scale);
}

/// Standstill: the twist is zero.
void MotionFilter::rest() {
  const Vector6 variance = squares(1e-3, 1e-4);
  for (int axis = 0; axis < 6; ++axis) {
    State h = State::Zero(states_);
    h[kTwist.begin + axis] = 1.0;
    update_scalar(h, -twist_base_[axis], variance[axis]);
  }
}

double MotionFilter::odds_against_slip() const { return -2.0 * std::log(std::expm1(kSlips_per_s * elapsed_s_)); }

/// Eq. 14 in docs/estimator.md: leave-one-out.
Innovation MotionFilter::innovation(SourceId id, const SensedTwist& sensed, bool slip_explained) const {
  const Source& source = sources_[index_of(id)];
  const Vector6& twist_base = sensed.mean;
  const Vector6 known = source.used ? source.known_variance : known_variance(source, twist_base);
  Innovation found;
  for (int axis = source.kind == SourceKind::imu ? 3 : 0; axis < 6; ++axis) {
    auto [h, expected] = row(source, sensed, axis);
    if (axis == kForward && !slip_explained) {
      h[*source.slip] = 0.0;
      expected -= x_[*source.slip];
    }
    const double after = h.dot(P_.matrix() * h);
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

double MotionFilter::contradiction(SourceId id, const SensedTwist& sensed) const {
  const Innovation found = innovation(id, sensed, true);
  const double late = kLateOdometry_s / elapsed_s_ * (twist_base_ - last_twist_base_)[kYawRate];
  return square(found.value[kYawRate]) / (found.variance[kYawRate] + square(late));
}

} // namespace locus
