// SPDX-License-Identifier: Apache-2.0
#include "locus_sim/synthetic_sources.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace locus::sim {
namespace {

constexpr double kShaken_mps = 0.5; // from here on vibration is at its full

} // namespace

SyntheticImu::SyntheticImu(const Trajectory& trajectory, double rate_hz, ImuFaults faults, std::uint64_t seed,
                           Pose T_base_imu)
    : trajectory_(trajectory), period_(from_seconds(1 / rate_hz)), faults_(std::move(faults)),
      T_base_imu_(std::move(T_base_imu)), gyro_bias_radps_(faults_.gyro_bias_radps), random_(seed),
      stamp_(trajectory.start()) {}

Eigen::Vector3d SyntheticImu::noise(double sigma) {
  const double x = normal_(random_), y = normal_(random_), z = normal_(random_);
  return sigma * Eigen::Vector3d{x, y, z};
}

/// Of the IMU, which the turning base swings about. The angular acceleration is that over a millisecond.
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
  ImuSample sample;
  sample.stamp = stamp_;
  sample.arrival = stamp_;
  sample.angular_velocity_radps =
      (1 + faults_.gyro_scale_error) * (T_base_imu_.rotation.conjugate() * motion.angular_velocity_base_radps) +
      gyro_bias_radps_ + noise(faults_.gyro_noise_radps);
  sample.specific_force_mps2 = R_world_imu.conjugate() * (acceleration_world_mps2(motion) + up) +
                               faults_.accelerometer_bias_mps2 +
                               noise(std::hypot(faults_.accelerometer_noise_mps2, shaking * faults_.vibration_mps2));
  sample.attitude = (so3_exp({0, 0, faults_.heading_rad}) * so3_exp(attitude_wander_rad_) * R_world_imu *
                     so3_exp(noise(faults_.attitude_noise_rad)))
                        .normalized();
  stamp_ += period_;
  return sample;
}

SyntheticOdometry::SyntheticOdometry(const Trajectory& trajectory, double rate_hz, const OdometryFaults& faults,
                                     std::uint64_t seed)
    : trajectory_(trajectory), period_(from_seconds(1 / rate_hz)), faults_(faults), random_(seed),
      stamp_(trajectory.start()), T_world_last_(trajectory.T_world_base(stamp_)) {}

OdometrySample SyntheticOdometry::next() {
  const Pose T_world_base = trajectory_.T_world_base(stamp_);
  Pose T_last_base = T_world_last_.inverse() * T_world_base;
  T_world_last_ = T_world_base;

  const double step_m = T_last_base.translation.norm(), root = std::sqrt(step_m);
  const double turn_rad = so3_log(T_last_base.rotation).z(), period_s = to_seconds(period_);
  const double dx = normal_(random_), dy = normal_(random_), dyaw = normal_(random_), dz = normal_(random_);
  T_last_base.translation *= 1 + faults_.scale_error;
  T_last_base.translation += root * Eigen::Vector3d{faults_.noise_m_per_sqrt_m * dx, faults_.noise_m_per_sqrt_m * dy,
                                                    faults_.climb_m_per_sqrt_m * dz};
  T_last_base.translation.x() += faults_.turn_slip_m_per_rad * std::abs(turn_rad) +
                                 faults_.spinning_mps * trajectory_.slip_ratio(stamp_) * period_s;
  const double veer_rad = faults_.yaw_drift_rad_per_m * step_m + faults_.noise_rad_per_sqrt_m * root * dyaw +
                          faults_.yaw_drift_rad_per_s * period_s + faults_.turn_error * turn_rad;
  T_last_base.rotation = T_last_base.rotation * so3_exp({0, 0, veer_rad});
  T_source_base_ = T_source_base_ * T_last_base;

  OdometrySample sample{stamp_, stamp_, T_source_base_};
  stamp_ += period_;
  return sample;
}

} // namespace locus::sim
