// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <random>

#include "core/motion_sample.hpp"
#include "locus_sim/trajectory.hpp"

namespace locus::sim {

/// Faults of an inertial measurement unit; as it stands, a perfect one.
struct ImuFaults {
  Eigen::Vector3d gyro_bias_radps = Eigen::Vector3d::Zero();
  double gyro_noise_radps = 0; ///< standard deviation of a sample
  Eigen::Vector3d accelerometer_bias_mps2 = Eigen::Vector3d::Zero();
  double accelerometer_noise_mps2 = 0;
  double attitude_noise_rad = 0;
};

/// An IMU in the origin of the base, turned as the base, that rides along a trajectory. One owner.
class SyntheticImu {
 public:
  /// The trajectory must outlive it. The same arguments give the same samples.
  SyntheticImu(const Trajectory& trajectory, double rate_hz, const ImuFaults& faults = {}, std::uint64_t seed = 1);

  ImuSample next(); ///< the first is at the start of the trajectory

 private:
  Eigen::Vector3d noise(double sigma);

  const Trajectory& trajectory_;
  Duration period_;
  ImuFaults faults_;
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
