// SPDX-License-Identifier: Apache-2.0
#include "core/odometry/motion_filter.hpp"

#include <Eigen/Eigenvalues>
#include <Eigen/LU>

#include <algorithm>
#include <cmath>
#include <span>

#include "core/odometry/motion_filter_states.hpp"

namespace locus {

using namespace motion_filter;

namespace {

constexpr double kAngularAcceleration_radps2 = 20.0; ///< standard deviation of the angular acceleration

/// Prior standard deviations of the slow common states, m/s^2.
constexpr double kAccelerometerBias = 0.1, kGravityError = 0.2;

/// Prior variance of the lidar extrinsics, per axis: brackets, drawings and a spirit level leave half a degree and a
/// centimetre in all. Considered, not estimated.
const Vector6 kMountingOfLidar = squares(0.006, 0.005);

const Vector6 kFirst = squares(0.003, 3e-4); ///< alignment variance of the first sweep of the map
const Vector6 kFloor = squares(0.001, 1e-4); ///< least pose variance against the submap: surfaces are known no better

Matrix6 diagonal(const Vector6& variances) { return variances.asDiagonal(); }

} // namespace

MotionFilter::MotionFilter(const std::vector<MotionSourceOptions>& sources, const MotionLimits& limits)
    : limits_(limits), acceleration_variance_(squares(0.5 * limits.max_acceleration_mps2, kAngularAcceleration_radps2)),
      count_(sources.size()) {
  for (std::size_t i = 0; i < count_; ++i)
    add_source(sources[i], sources_[i]);
  x_ = State::Zero(states_);
  for (const Source& source : std::span(sources_).first(count_))
    x_.segment(source.state, source.states) = source.first.head(source.states);
  P_.resize(states_);
  P_.add_variance(kAccelerometer, Eigen::Vector3d::Constant(square(kAccelerometerBias)));
  P_.add_variance(kGravity, Eigen::Vector3d::Constant(square(kGravityError)));
  P_.add_variance(kLever, Eigen::Vector3d::Constant(square(kLever_m)));
  for (std::size_t i = 0; i < count_; ++i)
    reset_source(SourceId{i});
}

void MotionFilter::begin(const Pose& T_odom_base, const Vector6& twist_base, const Vector6& twist_sigma,
                         const Matrix6& map_covariance) {
  T_odom_start_ = T_odom_base_ = T_odom_base;
  twist_base_ = twist_base;
  P_.reset(kPose.begin, diagonal(kFloor));
  P_.reset(kTwist.begin, diagonal(twist_sigma.cwiseAbs2()));
  P_.reset(kMap.begin, map_covariance + diagonal(kFirst));
  elapsed_s_ = 0.0;
}

/// Eq. 8 in docs/estimator.md. Applies a scalar measurement. Lateness and mounting of gyros are considered, not
/// corrected: only lidar makes them observable.
void MotionFilter::update_scalar(const State& h, double innovation, double variance) {
  const State Ph = P_.matrix() * h;
  const double innovation_variance = h.dot(Ph) + variance;
  State considered = of_map(Ph);
  for (const Source& source : std::span(sources_).first(count_))
    if (source.kind == SourceKind::imu)
      part(considered, source.lateness_and_mounting()) = part(Ph, source.lateness_and_mounting());
  P_.condition(Ph, considered, innovation_variance);
  correct((Ph - considered) / innovation_variance * innovation);
}

/// Returns the part of Ph that is always considered: the error of the map.
MotionFilter::State MotionFilter::of_map(const State& Ph) {
  State map = State::Zero(Ph.size());
  part(map, kMap) = part(Ph, kMap);
  return map;
}

/// Adds an error to the estimate: the rotation on the side of the odom frame, everything else as vectors.
void MotionFilter::correct(const State& error) {
  T_odom_base_ = {(so3_exp(part(error, kTurn)) * T_odom_base_.rotation).normalized(),
                  T_odom_base_.translation + part(error, kPosition)};
  twist_base_ += part(error, kTwist);
  x_.tail(states_ - kAccelerometer.begin) += error.tail(states_ - kAccelerometer.begin);
  part(x_, kMap).setZero();
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

/// D of eq. 13 in docs/estimator.md.
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

/// Eq. 12 in docs/estimator.md.
void MotionFilter::update(const Pose& T_odom_base, const Vector6& twist_base, const Matrix12& information) {
  const Matrix12 P = covariance();
  Vector12 moved;
  moved << difference(T_odom_base, T_odom_base_), twist_base - twist_base_;
  State error = P_.matrix().leftCols<12>() * P.inverse() * moved;
  error.head<12>().setZero();
  correct(error);
  // One eigenvector at a time, so that rounding in nearly unknown directions does not remain.
  const Eigen::SelfAdjointEigenSolver<Matrix12> eigen(information);
  for (int i = 0; i < 12; ++i) {
    if (eigen.eigenvalues()[i] <= 0.0)
      continue;
    const auto direction = eigen.eigenvectors().col(i);
    const State Ph = P_.matrix().leftCols<12>() * direction;
    P_.condition(Ph, of_map(Ph), Ph.head<12>().dot(direction) + 1.0 / eigen.eigenvalues()[i]);
  }
  P_.raise(kPose, kFloor);
  T_odom_base_ = T_odom_base;
  twist_base_ = twist_base;
}

/// Eq. 15 in docs/estimator.md.
void MotionFilter::transfer_error_to_map(const Matrix6& share) {
  Common transfer = Common::Identity();
  part(transfer, kPose, kPose) -= share;
  part(transfer, kMap, kPose) = share;
  P_.propagate(transfer);
  P_.raise(kPose, kFloor);
}

/// P_start of eq. 15 in docs/estimator.md.
Matrix6 MotionFilter::pose_covariance_since_start() const {
  const Matrix6 both = P_.block(kMap, kPose);
  return P_.block(kPose, kPose) + P_.block(kMap, kMap) + both + both.transpose() + of_mounting();
}

/// M P_lidar M' of eq. 15 in docs/estimator.md. Returns the pose covariance caused by an extrinsics error, relative to
/// the start: error of the first pose minus that of the last. Considered.
Matrix6 MotionFilter::of_mounting() const {
  const Matrix6 error =
      transport(T_odom_base_.translation - T_odom_start_.translation) * turn_both(T_odom_start_.rotation) -
      turn_both(T_odom_base_.rotation);
  return error * kMountingOfLidar.asDiagonal() * error.transpose();
}

void MotionFilter::set_pose(const Pose& T_odom_base) { T_odom_base_ = T_odom_base; }

} // namespace locus
