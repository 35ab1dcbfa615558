// SPDX-License-Identifier: Apache-2.0
#include "core/base/pose.hpp"

#include <cmath>

namespace locus {

namespace {

/// Angle below which the closed forms lose digits and the series are exact to double precision.
constexpr double kSmallAngleRad = 1e-4;

/// Matrix V of SE(3): the translation of exp(v, w) is V(w) * v.
Eigen::Matrix3d left_jacobian(const Eigen::Vector3d& w) {
  const double angle2 = w.squaredNorm();
  const double angle = std::sqrt(angle2);
  const bool small = angle < kSmallAngleRad;
  const double a = small ? 0.5 - angle2 / 24.0 : (1.0 - std::cos(angle)) / angle2;
  const double b = small ? 1.0 / 6.0 - angle2 / 120.0 : (angle - std::sin(angle)) / (angle2 * angle);
  const Eigen::Matrix3d W = skew(w);
  return Eigen::Matrix3d::Identity() + a * W + b * W * W;
}

} // namespace

Eigen::Matrix3d skew(const Eigen::Vector3d& v) {
  Eigen::Matrix3d m;
  m << 0.0, -v.z(), v.y(), v.z(), 0.0, -v.x(), -v.y(), v.x(), 0.0;
  return m;
}

bool is_rotation(const Eigen::Quaterniond& quaternion) {
  constexpr double kTolerance = 0.01; ///< of the squared norm
  return std::abs(quaternion.squaredNorm() - 1.0) < kTolerance;
}

Eigen::Quaterniond so3_exp(const Eigen::Vector3d& rotation_vector_rad) {
  const double angle = rotation_vector_rad.norm();
  const double sine_over_angle = angle < kSmallAngleRad ? 0.5 - angle * angle / 48.0 : std::sin(0.5 * angle) / angle;
  const Eigen::Vector3d xyz = sine_over_angle * rotation_vector_rad;
  return Eigen::Quaterniond{std::cos(0.5 * angle), xyz.x(), xyz.y(), xyz.z()}.normalized();
}

Eigen::Vector3d so3_log(const Eigen::Quaterniond& rotation) {
  const double sign = rotation.w() < 0.0 ? -1.0 : 1.0;
  const Eigen::Vector3d xyz = sign * rotation.vec();
  const double sine = xyz.norm();
  if (sine < 0.5 * kSmallAngleRad)
    return 2.0 * xyz;
  return 2.0 * std::atan2(sine, sign * rotation.w()) / sine * xyz;
}

Vector6 along_each_axis(double translation_m, double rotation_deg) {
  const double rotation_rad = rotation_deg * kRadPerDeg;
  Vector6 v;
  v << Eigen::Vector3d::Constant(translation_m), Eigen::Vector3d::Constant(rotation_rad);
  return v;
}

Pose se3_exp(const Vector6& tangent) {
  const Eigen::Vector3d w = tangent.tail<3>();
  return {so3_exp(w), left_jacobian(w) * tangent.head<3>()};
}

Vector6 se3_log(const Pose& pose) {
  const Eigen::Vector3d w = so3_log(pose.rotation);
  Vector6 tangent;
  tangent << left_jacobian(w).inverse() * pose.translation, w;
  return tangent;
}

Matrix6 adjoint(const Pose& T_a_b) {
  const Eigen::Matrix3d R = T_a_b.R();
  Matrix6 ad = Matrix6::Zero();
  ad.topLeftCorner<3, 3>() = R;
  ad.topRightCorner<3, 3>() = skew(T_a_b.translation) * R;
  ad.bottomRightCorner<3, 3>() = R;
  return ad;
}

Matrix6 turn_both(const Eigen::Quaterniond& rotation) {
  Matrix6 R = Matrix6::Zero();
  R.topLeftCorner<3, 3>() = R.bottomRightCorner<3, 3>() = rotation.toRotationMatrix();
  return R;
}

Matrix6 transport(const Eigen::Vector3d& moved_m) {
  Matrix6 further = Matrix6::Identity();
  further.topRightCorner<3, 3>() = -skew(moved_m);
  return further;
}

Vector6 difference(const Pose& T_a_b, const Pose& T_a_reference) {
  Vector6 d;
  d << T_a_b.translation - T_a_reference.translation, so3_log(T_a_b.rotation * T_a_reference.rotation.conjugate());
  return d;
}

Pose interpolate(const Pose& T_a_from, const Pose& T_a_to, double fraction) {
  const Eigen::Vector3d turn = so3_log(T_a_from.rotation.conjugate() * T_a_to.rotation);
  return {(T_a_from.rotation * so3_exp(fraction * turn)).normalized(),
          T_a_from.translation + fraction * (T_a_to.translation - T_a_from.translation)};
}

double angle_rad(const Eigen::Quaterniond& rotation) {
  return 2.0 * std::atan2(rotation.vec().norm(), std::abs(rotation.w()));
}

Eigen::Quaterniond from_rpy_rad(const Eigen::Vector3d& rpy_rad) {
  return Eigen::Quaterniond{Eigen::AngleAxisd(rpy_rad.z(), Eigen::Vector3d::UnitZ()) *
                            Eigen::AngleAxisd(rpy_rad.y(), Eigen::Vector3d::UnitY()) *
                            Eigen::AngleAxisd(rpy_rad.x(), Eigen::Vector3d::UnitX())};
}

Eigen::Vector3d to_rpy_rad(const Eigen::Quaterniond& rotation) {
  constexpr double kGimbalLock = 1e-9; // cosine of the pitch below which rounding makes the yaw meaningless
  const Eigen::Matrix3d R = rotation.toRotationMatrix();
  const double yaw = std::hypot(R(0, 0), R(1, 0)) < kGimbalLock ? 0.0 : std::atan2(R(1, 0), R(0, 0));
  // Ry(pitch) Rx(roll) remains when the yaw is removed: exact for any yaw, and therefore also close to gimbal lock.
  const Eigen::Matrix3d R_pitch_roll = Eigen::AngleAxisd(-yaw, Eigen::Vector3d::UnitZ()).toRotationMatrix() * R;
  return {std::atan2(-R_pitch_roll(1, 2), R_pitch_roll(1, 1)), std::atan2(-R_pitch_roll(2, 0), R_pitch_roll(0, 0)),
          yaw};
}

} // namespace locus
