// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <numbers>

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace locus {

/// Degrees are used where people read and write angles, radians everywhere else.
inline constexpr double kRadPerDeg = std::numbers::pi / 180;

/// Tangent of SE(3): translation (m) first, then rotation (rad). Order of every 6-vector and 6x6 matrix of the project.
using Vector6 = Eigen::Matrix<double, 6, 1>;
using Matrix6 = Eigen::Matrix<double, 6, 6>;

/// Rigid transform. A variable T_a_b transforms a point from frame b to frame a: p_a = T_a_b * p_b.
struct Pose {
  Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();
  Eigen::Vector3d translation = Eigen::Vector3d::Zero(); ///< metres

  [[nodiscard]] Pose inverse() const {
    const Eigen::Quaterniond r = rotation.conjugate();
    return {r, -(r * translation)};
  }
  [[nodiscard]] Eigen::Matrix3d R() const { return rotation.toRotationMatrix(); }
  bool operator==(const Pose&) const = default;
  [[nodiscard]] bool finite() const { return rotation.coeffs().allFinite() && translation.allFinite(); }

  friend Pose operator*(const Pose& T_a_b, const Pose& T_b_c) {
    return {(T_a_b.rotation * T_b_c.rotation).normalized(), T_a_b.rotation * T_b_c.translation + T_a_b.translation};
  }
  friend Eigen::Vector3d operator*(const Pose& T_a_b, const Eigen::Vector3d& p_b) {
    return T_a_b.rotation * p_b + T_a_b.translation;
  }
};

/// Returns the matrix with skew(v) * w == v x w.
Eigen::Matrix3d skew(const Eigen::Vector3d& v);

/// Tells whether a quaternion is a rotation, that is, of unit length up to rounding; false for NaN. The tolerance is
/// that of tf2.
bool is_rotation(const Eigen::Quaterniond& quaternion);

/// Convert a rotation vector (rad) to a rotation and back; log returns the shorter rotation.
Eigen::Quaterniond so3_exp(const Eigen::Vector3d& rotation_vector_rad);
Eigen::Vector3d so3_log(const Eigen::Quaterniond& rotation);

/// Returns a tangent with the same value along each axis.
Vector6 along_each_axis(double translation_m, double rotation_deg);

/// SE(3) exponential of a twist held for unit time, and its inverse.
Pose se3_exp(const Vector6& tangent);
Vector6 se3_log(const Pose& pose);

/// Adjoint Ad(T) of T_a_b: transforms a twist from frame b to frame a.
Matrix6 adjoint(const Pose& T_a_b);

/// Returns the block-diagonal matrix that rotates both halves of a tangent.
Matrix6 turn_both(const Eigen::Quaterniond& rotation);

/// Returns the Jacobian that transports a pose error (translation, rotation along fixed axes) to a pose `moved_m`
/// further on: an error of rotation shifts the positions ahead.
Matrix6 transport(const Eigen::Vector3d& moved_m);

/// Returns T_a_b - T_a_reference as translation and rotation, both along the axes of a.
Vector6 difference(const Pose& T_a_b, const Pose& T_a_reference);

/// Interpolates linearly in translation, by slerp in rotation; fraction 0 is `from`, 1 is `to`, others extrapolate.
Pose interpolate(const Pose& T_a_from, const Pose& T_a_to, double fraction);

/// Returns the angle of the rotation, 0..pi.
double angle_rad(const Eigen::Quaterniond& rotation);

/// Returns the rotation of intrinsic yaw, pitch, roll: Rz(yaw) Ry(pitch) Rx(roll).
Eigen::Quaterniond from_rpy_rad(const Eigen::Vector3d& rpy_rad);

/// Inverse of from_rpy_rad(): pitch in -pi/2..pi/2. In gimbal lock, where yaw and roll share an axis, yaw is 0.
Eigen::Vector3d to_rpy_rad(const Eigen::Quaterniond& rotation);

} // namespace locus
