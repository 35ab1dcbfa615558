// SPDX-License-Identifier: Apache-2.0
#include "core/imu_self_check.hpp"

#include <algorithm>
#include <cmath>

namespace locus {

namespace {

constexpr Duration kWeighFor = std::chrono::seconds{1};
constexpr double kGravityTolerance = 0.15; ///< of the whole: a robot may be driving off
constexpr double kMaxTilt_deg = 60.0;      ///< no robot begins on a steeper slope

/// Turn rates of lidar below this are noise beside the gyro's.
constexpr double kTurns_radps = 0.15;
/// After so many turning sweeps the comparison is sure.
constexpr int kSweepsToCompare = 10;
constexpr double kDegPerRad = 57.3;

constexpr Duration kMaxGap = std::chrono::milliseconds{100};   ///< across which a gyro can be followed
constexpr Duration kResolution = std::chrono::milliseconds{5}; ///< of what is remembered of its turns

bool is_about(double value, double expected, double tolerance) {
  return std::abs(value - expected) < tolerance * expected;
}

} // namespace

std::optional<HealthReason> ImuSelfCheck::judge(const SourceReading& reading) {
  if (refused_)
    return HealthReason::self_check;
  follow_turns(R_base_imu_ * reading.imu->angular_velocity_radps, reading.stamp);
  weigh(R_base_imu_ * reading.imu->specific_force_mps2, reading.stamp);
  return refused_ ? std::optional{HealthReason::self_check} : std::nullopt;
}

void ImuSelfCheck::weigh(const Eigen::Vector3d& specific_force_base_mps2, Stamp stamp) {
  if (weighed_)
    return;
  if (!first_)
    first_ = stamp;
  force_sum_mps2_ += specific_force_base_mps2;
  forces_ += 1.0;
  if (stamp - *first_ >= kWeighFor)
    weigh_gravity();
}

void ImuSelfCheck::follow_turns(const Eigen::Vector3d& turn_rate_base_radps, Stamp stamp) {
  if (last_ && stamp > *last_ && stamp - *last_ < kMaxGap)
    angle_rad_ += to_seconds(stamp - *last_) * turn_rate_base_radps;
  else if (last_)
    known_ = 0;
  last_ = stamp;
  if (known_ > 0 && stamp - turned_[newest_].stamp < kResolution)
    return;
  newest_ = (newest_ + 1) % turned_.size();
  turned_[newest_] = {stamp, angle_rad_};
  known_ = std::min(known_ + 1, turned_.size());
}

const ImuSelfCheck::Turned* ImuSelfCheck::turned_at(Stamp stamp) const {
  for (std::size_t age = 0; age < known_; ++age) {
    const Turned& turned = turned_[(newest_ + turned_.size() - age) % turned_.size()];
    if (turned.stamp <= stamp)
      return &turned;
  }
  return nullptr;
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
  if (refused_ || turning_sweeps_ == kSweepsToCompare || !weighed_ || !feedback.twist_base)
    return std::nullopt;
  const Turned* const from = turned_at(feedback.from);
  const Turned* const to = turned_at(feedback.to);
  if (from == nullptr || from->stamp >= to->stamp)
    return std::nullopt;
  const Eigen::Vector3d gyro = (to->angle_rad - from->angle_rad) / to_seconds(to->stamp - from->stamp);
  const Eigen::Vector3d lidar = feedback.twist_base->tail<3>();
  if (lidar.norm() < kTurns_radps)
    return std::nullopt;
  lidar_lidar_ += lidar.squaredNorm();
  gyro_lidar_ += gyro.dot(lidar);
  gyro_gyro_ += gyro.squaredNorm();
  if (++turning_sweeps_ == kSweepsToCompare)
    compare_turns();
  return refused_ ? std::optional{HealthReason::self_check} : std::nullopt;
}

void ImuSelfCheck::compare_turns() {
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
