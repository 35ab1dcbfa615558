// SPDX-License-Identifier: Apache-2.0
#include "core/imu_self_check.hpp"

#include <cmath>

namespace locus {

namespace {

constexpr Duration kWeighFor = std::chrono::seconds{1};
constexpr double kGravity_mps2 = 9.80665;
constexpr double kGravityTolerance = 0.15; ///< of the whole: a robot may be driving off
constexpr double kMaxTilt_deg = 60.0;      ///< no robot begins on a steeper slope

/// Turn rates of lidar below this are noise beside the gyro's.
constexpr double kTurns_radps = 0.15;
/// Sum of squared turn rates (per sweep) after which the comparison is sure: a second of an ordinary turn.
constexpr double kEnoughTurning = 2.0;
constexpr double kDegPerRad = 57.3;

bool is_about(double value, double expected, double tolerance) {
  return std::abs(value - expected) < tolerance * expected;
}

} // namespace

std::optional<HealthReason> ImuSelfCheck::judge(const SourceReading& reading) {
  if (refused_)
    return HealthReason::self_check;
  turn_sum_radps_ += R_base_imu_ * reading.imu->angular_velocity_radps;
  turns_ += 1.0;
  if (weighed_)
    return std::nullopt;
  if (!first_)
    first_ = reading.stamp;
  force_sum_mps2_ += R_base_imu_ * reading.imu->specific_force_mps2;
  forces_ += 1.0;
  if (reading.stamp - *first_ >= kWeighFor)
    weigh_gravity();
  return refused_ ? std::optional{HealthReason::self_check} : std::nullopt;
}

void ImuSelfCheck::weigh_gravity() {
  weighed_ = true;
  const Eigen::Vector3d force = force_sum_mps2_ / forces_;
  if (is_about(force.norm(), 1.0, kGravityTolerance)) {
    trusts_accelerometer_ = false;
    verdict_ = "reports accelerations in g, not in m/s^2: they are not used";
  } else if (!is_about(force.norm(), kGravity_mps2, kGravityTolerance)) {
    trusts_accelerometer_ = false;
    verdict_ = "reports accelerations that are not those of gravity: they are not used";
  }
  if (force.norm() > 0.0 && force.normalized().z() < std::cos(kMaxTilt_deg / kDegPerRad))
    refuse(
        "gravity is not below the robot: T_base_source is wrong, or the unit is mounted another way; it is not used");
}

std::optional<HealthReason> ImuSelfCheck::hear(LidarOpinion /*opinion*/, const RegistrationFeedback& feedback) {
  if (turns_ == 0.0 || compared_ || !feedback.twist_base)
    return std::nullopt;
  const Eigen::Vector3d gyro = turn_sum_radps_ / turns_;
  const Eigen::Vector3d lidar = feedback.twist_base->tail<3>();
  turn_sum_radps_.setZero();
  turns_ = 0.0;
  if (lidar.norm() < kTurns_radps)
    return std::nullopt;
  lidar_lidar_ += lidar.squaredNorm();
  gyro_lidar_ += gyro.dot(lidar);
  gyro_gyro_ += gyro.squaredNorm();
  if (lidar_lidar_ > kEnoughTurning)
    compare_turns();
  return refused_ ? std::optional{HealthReason::self_check} : std::nullopt;
}

void ImuSelfCheck::compare_turns() {
  compared_ = true;
  const double likeness = gyro_lidar_ / std::sqrt(gyro_gyro_ * lidar_lidar_);
  const double scale = gyro_lidar_ / lidar_lidar_;
  constexpr double kAlike = 0.7;
  if (likeness > kAlike && is_about(scale, kDegPerRad, 0.3))
    refuse("reports turn rates in deg/s, not in rad/s: it is not used");
  else if (likeness < -kAlike)
    refuse(
        "turns the other way than lidar sees: T_base_source is wrong, or an axis has the wrong sign; it is not used");
  else if (!(likeness > kAlike) || !is_about(scale, 1.0, 0.3))
    refuse("does not turn as lidar sees the robot turn: T_base_source or its scale is wrong; it is not used");
}

void ImuSelfCheck::refuse(std::string_view verdict) {
  refused_ = true;
  verdict_ = verdict;
}

} // namespace locus
