// SPDX-License-Identifier: Apache-2.0
#include "locus_sim/synthetic_sources.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "locus_sim/dice.hpp"

namespace locus::sim {
namespace {

constexpr double kShaken_mps = 0.5; // speed of full vibration

} // namespace

Stamp SourceClock::stamp_of(Stamp measured) {
  const Duration jitter = faults_.jitter_s > 0 ? from_seconds(faults_.jitter_s * dice_.normal()) : Duration::zero();
  last_ = std::max(last_ + kStep, measured + faults_.late + jitter);
  return last_;
}

SyntheticImu::SyntheticImu(const Trajectory& trajectory, double rate_hz, ImuFaults faults, std::uint64_t seed,
                           Pose T_base_imu)
    : trajectory_(trajectory), period_(from_seconds(1 / rate_hz)), faults_(std::move(faults)),
      T_base_imu_(std::move(T_base_imu)), gyro_bias_radps_(faults_.gyro_bias_radps), random_(seed),
      stamp_(trajectory.start()), clock_(faults_.stamps, seed_for(seed, "IMU stamps"), trajectory.start()) {
  const Eigen::Quaterniond R_world_imu = trajectory.T_world_base(stamp_).rotation * T_base_imu_.rotation;
  force_at_rest_mps2_ = R_world_imu.conjugate() * Eigen::Vector3d{0, 0, kGravity_mps2};
}

Eigen::Vector3d SyntheticImu::noise(double sigma) {
  const double x = normal_(random_), y = normal_(random_), z = normal_(random_);
  return sigma * Eigen::Vector3d{x, y, z};
}

/// Returns the acceleration of the IMU, including its lever arm. The angular acceleration is a difference over a
/// millisecond.
Eigen::Vector3d SyntheticImu::acceleration_world_mps2(const BaseMotion& motion) const {
  constexpr Duration kHalf = std::chrono::microseconds{500};
  const auto turning_radps = [](const BaseMotion& at) -> Eigen::Vector3d {
    return at.T_world_base.rotation * at.angular_velocity_base_radps;
  };
  const Eigen::Vector3d lever_m = motion.T_world_base.rotation * T_base_imu_.translation;
  if (lever_m.isZero(0))
    return motion.acceleration_world_mps2;
  const Eigen::Vector3d w = turning_radps(motion);
  const Eigen::Vector3d w_rate =
      (turning_radps(trajectory_.at(stamp_ + kHalf)) - turning_radps(trajectory_.at(stamp_ - kHalf))) /
      to_seconds(2 * kHalf);
  return motion.acceleration_world_mps2 + w_rate.cross(lever_m) + w.cross(w.cross(lever_m));
}

ImuSample SyntheticImu::next() {
  constexpr double kWanderTime_s = 20;
  const BaseMotion motion = trajectory_.at(stamp_);
  const Eigen::Quaterniond R_world_imu = motion.T_world_base.rotation * T_base_imu_.rotation;
  const Eigen::Vector3d up{0, 0, kGravity_mps2};
  const double period_s = to_seconds(period_);
  const double shaking = std::min(1.0, motion.velocity_world_mps.norm() / kShaken_mps);
  gyro_bias_radps_ += noise(faults_.gyro_bias_walk_radps_per_sqrt_s * std::sqrt(period_s));
  attitude_wander_rad_ += -period_s / kWanderTime_s * attitude_wander_rad_ +
                          noise(faults_.attitude_wander_rad * std::sqrt(2 * period_s / kWanderTime_s));
  const Eigen::Vector3d turning_radps =
      (1 + faults_.gyro_scale_error) * (T_base_imu_.rotation.conjugate() * motion.angular_velocity_base_radps);
  const Eigen::Vector3d force_mps2 = R_world_imu.conjugate() * (acceleration_world_mps2(motion) + up);
  ImuSample sample;
  sample.stamp = clock_.stamp_of(stamp_);
  sample.arrival = sample.stamp;
  sample.angular_velocity_radps =
      turning_radps.cwiseProduct((1 + faults_.gyro_axis_scale_error.array()).matrix()) + gyro_bias_radps_ +
      faults_.gyro_g_sensitivity_sm * (force_mps2 - force_at_rest_mps2_) + noise(faults_.gyro_noise_radps);
  sample.specific_force_mps2 = force_mps2 + faults_.accelerometer_bias_mps2 +
                               noise(std::hypot(faults_.accelerometer_noise_mps2, shaking * faults_.vibration_mps2));
  sample.attitude = (so3_exp({0, 0, faults_.heading_rad}) * so3_exp(attitude_wander_rad_) * R_world_imu *
                     so3_exp(noise(faults_.attitude_noise_rad)))
                        .normalized();
  stamp_ += period_;
  return sample;
}

SlipBursts::SlipBursts(const Trajectory& trajectory, double per_min, std::uint64_t seed)
    : trajectory_(trajectory), per_min_(per_min), dice_(seed) {
  if (per_min_ > 0)
    draw(trajectory.start());
}

/// Draws the next burst, independent of the others. Wheels spin while the robot accelerates or cruises, and drag while
/// it decelerates.
void SlipBursts::draw(Stamp after) {
  constexpr double kShortest_s = 0.5, kLongest_s = 2, kLeast = 0.2, kMost = 1, kBraking_mps = 0.2;
  from_ = after + from_seconds(-60 / per_min_ * std::log1p(-dice_.uniform()));
  to_ = from_ + from_seconds(kShortest_s + (kLongest_s - kShortest_s) * dice_.uniform());
  const double size = kLeast + (kMost - kLeast) * dice_.uniform();
  const auto speed_mps = [&](Stamp stamp) { return trajectory_.at(stamp).velocity_world_mps.norm(); };
  share_ = speed_mps(to_) < speed_mps(from_) - kBraking_mps ? 1 - size : 1 + size;
}

double SlipBursts::reported_share(Stamp stamp) {
  if (per_min_ <= 0)
    return 1;
  while (stamp > to_)
    draw(to_);
  return stamp > from_ ? share_ : 1;
}

SyntheticOdometry::SyntheticOdometry(const Trajectory& trajectory, double rate_hz, const OdometryFaults& faults,
                                     std::uint64_t seed)
    : trajectory_(trajectory), period_(from_seconds(1 / rate_hz)), faults_(faults), random_(seed),
      stamp_(trajectory.start()), clock_(faults.stamps, seed_for(seed, "odometry stamps"), trajectory.start()),
      bursts_(trajectory, faults.slip_bursts_per_min, seed_for(seed, "slip bursts")),
      T_world_last_(trajectory.T_world_base(stamp_)) {}

OdometrySample SyntheticOdometry::next() {
  const Pose T_world_base = trajectory_.T_world_base(stamp_);
  Pose T_last_base = T_world_last_.inverse() * T_world_base;
  T_world_last_ = T_world_base;

  const double step_m = T_last_base.translation.norm(), root = std::sqrt(step_m);
  const double turn_rad = so3_log(T_last_base.rotation).z(), period_s = to_seconds(period_);
  const double dx = normal_(random_), dy = normal_(random_), dyaw = normal_(random_), dz = normal_(random_);
  T_last_base.translation *= 1 + faults_.scale_error;
  T_last_base.translation.x() *= bursts_.reported_share(stamp_);
  T_last_base.translation += root * Eigen::Vector3d{faults_.noise_m_per_sqrt_m * dx, faults_.noise_m_per_sqrt_m * dy,
                                                    faults_.climb_m_per_sqrt_m * dz};
  T_last_base.translation.x() += faults_.turn_slip_m_per_rad * std::abs(turn_rad) +
                                 faults_.spinning_mps * trajectory_.slip_ratio(stamp_) * period_s;
  const double veer_rad = faults_.yaw_drift_rad_per_m * step_m + faults_.noise_rad_per_sqrt_m * root * dyaw +
                          faults_.yaw_drift_rad_per_s * period_s + faults_.turn_error * turn_rad;
  T_last_base.rotation = T_last_base.rotation * so3_exp({0, 0, veer_rad});
  T_source_base_ = T_source_base_ * T_last_base;

  const Stamp stamp = clock_.stamp_of(stamp_);
  stamp_ += period_;
  return {stamp, stamp, T_source_base_};
}

} // namespace locus::sim
