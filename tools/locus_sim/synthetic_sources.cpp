// SPDX-License-Identifier: Apache-2.0
#include "locus_sim/synthetic_sources.hpp"

#include <cmath>

namespace locus::sim {
namespace {

constexpr double kGravity_mps2 = 9.81;

} // namespace

SyntheticImu::SyntheticImu(const Trajectory& trajectory, double rate_hz, const ImuFaults& faults, std::uint64_t seed)
    : trajectory_(trajectory), period_(from_seconds(1 / rate_hz)), faults_(faults), random_(seed),
      stamp_(trajectory.start()) {}

Eigen::Vector3d SyntheticImu::noise(double sigma) {
  const double x = normal_(random_), y = normal_(random_), z = normal_(random_);
  return sigma * Eigen::Vector3d{x, y, z};
}

ImuSample SyntheticImu::next() {
  const BaseMotion motion = trajectory_.at(stamp_);
  const Eigen::Quaterniond& R_world_imu = motion.T_world_base.rotation;
  const Eigen::Vector3d up{0, 0, kGravity_mps2};
  ImuSample sample;
  sample.stamp = stamp_;
  sample.arrival = stamp_;
  sample.angular_velocity_radps =
      motion.angular_velocity_base_radps + faults_.gyro_bias_radps + noise(faults_.gyro_noise_radps);
  sample.specific_force_mps2 = R_world_imu.conjugate() * (motion.acceleration_world_mps2 + up) +
                               faults_.accelerometer_bias_mps2 + noise(faults_.accelerometer_noise_mps2);
  sample.attitude = (R_world_imu * so3_exp(noise(faults_.attitude_noise_rad))).normalized();
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
  const double dx = normal_(random_), dy = normal_(random_), dyaw = normal_(random_);
  T_last_base.translation *= 1 + faults_.scale_error;
  T_last_base.translation += faults_.noise_m_per_sqrt_m * root * Eigen::Vector3d{dx, dy, 0};
  const double veer_rad = faults_.yaw_drift_rad_per_m * step_m + faults_.noise_rad_per_sqrt_m * root * dyaw;
  T_last_base.rotation = T_last_base.rotation * so3_exp({0, 0, veer_rad});
  T_source_base_ = T_source_base_ * T_last_base;

  OdometrySample sample{stamp_, stamp_, T_source_base_};
  stamp_ += period_;
  return sample;
}

} // namespace locus::sim
