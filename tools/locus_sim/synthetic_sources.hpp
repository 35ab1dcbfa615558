// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <random>

#include "core/motion_sample.hpp"
#include "locus_sim/trajectory.hpp"

namespace locus::sim {

/// Faults of an inertial measurement unit; as it stands, a perfect one.
struct ImuFaults {
  Eigen::Vector3d gyro_bias_radps = Eigen::Vector3d::Zero();
  double gyro_noise_radps = 0;                ///< standard deviation of a sample
  double gyro_bias_walk_radps_per_sqrt_s = 0; ///< random walk of the bias
  double gyro_scale_error = 0;                ///< 0.002: it shows 0.2 % too much
  Eigen::Vector3d accelerometer_bias_mps2 = Eigen::Vector3d::Zero();
  double accelerometer_noise_mps2 = 0;
  double vibration_mps2 = 0;      ///< more noise of the accelerometer, in full at 0.5 m/s
  double attitude_noise_rad = 0;  ///< of a sample
  double attitude_wander_rad = 0; ///< slow error of the filter that makes the attitude
  double heading_rad = 0;         ///< of its attitude when the heading is truly 0
};

/// An IMU that rides along a trajectory. One owner.
class SyntheticImu {
 public:
  /// The trajectory must outlive it. The same arguments give the same samples.
  SyntheticImu(const Trajectory& trajectory, double rate_hz, ImuFaults faults = {}, std::uint64_t seed = 1,
               Pose T_base_imu = {});

  ImuSample next(); ///< the first is at the start of the trajectory

 private:
  Eigen::Vector3d noise(double sigma);
  [[nodiscard]] Eigen::Vector3d acceleration_world_mps2(const BaseMotion& motion) const;

  const Trajectory& trajectory_;
  Duration period_;
  ImuFaults faults_;
  Pose T_base_imu_;
  Eigen::Vector3d gyro_bias_radps_;
  Eigen::Vector3d attitude_wander_rad_ = Eigen::Vector3d::Zero();
  std::mt19937_64 random_;
  std::normal_distribution<double> normal_;
  Stamp stamp_;
};

/// Faults of an odometry source; as it stands, a perfect one.
struct OdometryFaults {
  double scale_error = 0;          ///< 0.02: it reports 2 % more metres than were driven (slip, tyre pressure)
  double yaw_drift_rad_per_m = 0;  ///< it veers to the left of what was driven
  double noise_m_per_sqrt_m = 0;   ///< random walk of the position over the distance
  double noise_rad_per_sqrt_m = 0; ///< random walk of the heading over the distance
  double yaw_drift_rad_per_s = 0;  ///< it turns to the left even where the robot stands
  double turn_error = 0;           ///< 0.02: it reports turns 2 % too large
  double turn_slip_m_per_rad = 0;  ///< metres ahead that were not driven, for every radian turned (skidding wheels)
  double climb_m_per_sqrt_m = 0;   ///< random walk of the height over the distance
  double spinning_mps = 0;         ///< that it reports while wheels or feet slip; 0: it does not feel them
};

/// Wheel or visual odometry: the true motion, step by step, with faults that add up. Starts at identity. One owner.
class SyntheticOdometry {
 public:
  /// The trajectory must outlive it. The same arguments give the same samples.
  SyntheticOdometry(const Trajectory& trajectory, double rate_hz, const OdometryFaults& faults = {},
                    std::uint64_t seed = 1);

  OdometrySample next(); ///< the first is at the start of the trajectory

 private:
  const Trajectory& trajectory_;
  Duration period_;
  OdometryFaults faults_;
  std::mt19937_64 random_;
  std::normal_distribution<double> normal_;
  Stamp stamp_;
  Pose T_world_last_;
  Pose T_source_base_;
};

} // namespace locus::sim
