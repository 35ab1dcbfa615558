// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <random>

#include "core/sources/motion_sample.hpp"
#include "locus_sim/quick_dice.hpp"
#include "locus_sim/trajectory.hpp"

namespace locus::sim {

/// Errors of the stamps of a source.
struct StampFaults {
  Duration late{};     ///< relative to the measurement
  double jitter_s = 0; ///< standard deviation
};

/// Stamps of a source's measurements, strictly increasing. One owner.
class SourceClock {
 public:
  SourceClock(const StampFaults& faults, std::uint64_t seed, Stamp start)
      : faults_(faults), dice_(seed), last_(start - kStep) {}

  Stamp stamp_of(Stamp measured);

 private:
  static constexpr Duration kStep = std::chrono::microseconds{1};

  StampFaults faults_;
  QuickDice dice_;
  Stamp last_;
};

/// Faults of an inertial measurement unit; none by default.
struct ImuFaults {
  StampFaults stamps{};
  Eigen::Vector3d gyro_bias_radps = Eigen::Vector3d::Zero();
  double gyro_noise_radps = 0;                                     ///< standard deviation per sample
  double gyro_bias_walk_radps_per_sqrt_s = 0;                      ///< bias random walk
  double gyro_scale_error = 0;                                     ///< 0.002: it reports 0.2 % too much
  Eigen::Vector3d gyro_axis_scale_error = Eigen::Vector3d::Zero(); ///< same for each axis, in addition
  /// rad/s per m/s^2 of specific force, relative to that at rest at the start of the trajectory, where the gyro was
  /// calibrated.
  Eigen::Matrix3d gyro_g_sensitivity_sm = Eigen::Matrix3d::Zero();
  Eigen::Vector3d accelerometer_bias_mps2 = Eigen::Vector3d::Zero();
  double accelerometer_noise_mps2 = 0;
  double vibration_mps2 = 0;      ///< additional accelerometer noise, fully from 0.5 m/s on
  double attitude_noise_rad = 0;  ///< per sample
  double attitude_wander_rad = 0; ///< slow error of the attitude filter
  double heading_rad = 0;         ///< reported when the true heading is 0
};

/// IMU that moves along a trajectory. One owner.
class SyntheticImu {
 public:
  /// The trajectory must outlive it. The same arguments give the same samples.
  SyntheticImu(const Trajectory& trajectory, double rate_hz, ImuFaults faults = {}, std::uint64_t seed = 1,
               Pose T_base_imu = {});

  ImuSample next(); ///< starts at the start of the trajectory

 private:
  Eigen::Vector3d noise(double sigma);
  [[nodiscard]] Eigen::Vector3d acceleration_world_mps2(const BaseMotion& motion) const;

  const Trajectory& trajectory_;
  Duration period_;
  ImuFaults faults_;
  Pose T_base_imu_;
  Eigen::Vector3d gyro_bias_radps_;
  Eigen::Vector3d attitude_wander_rad_ = Eigen::Vector3d::Zero();
  Eigen::Vector3d force_at_rest_mps2_; ///< at the start of the trajectory
  std::mt19937_64 random_;
  std::normal_distribution<double> normal_;
  Stamp stamp_; ///< of the next measurement
  SourceClock clock_;
};

/// Faults of an odometry source; none by default.
struct OdometryFaults {
  StampFaults stamps{};
  double scale_error = 0;          ///< 0.02: it reports 2 % too much distance (slip, tyre pressure)
  double yaw_drift_rad_per_m = 0;  ///< it drifts to the left
  double noise_m_per_sqrt_m = 0;   ///< position random walk over distance
  double noise_rad_per_sqrt_m = 0; ///< heading random walk over distance
  double yaw_drift_rad_per_s = 0;  ///< it drifts to the left even at rest
  double turn_error = 0;           ///< 0.02: it reports turns 2 % too large
  double turn_slip_m_per_rad = 0;  ///< false forward metres per radian turned (skidding wheels)
  double climb_m_per_sqrt_m = 0;   ///< height random walk over distance
  double spinning_mps = 0;         ///< reported while wheels or feet slip; 0: insensitive to slip
  double slip_bursts_per_min = 0;  ///< bursts of too much forward motion, or too little while braking
};

/// Random bursts of slip while the robot moves, of half a second to two. One owner.
class SlipBursts {
 public:
  /// The trajectory must outlive it.
  SlipBursts(const Trajectory& trajectory, double per_min, std::uint64_t seed);

  /// Returns reported over true forward motion; call in chronological order.
  double reported_share(Stamp stamp);

 private:
  void draw(Stamp after);

  const Trajectory& trajectory_;
  double per_min_;
  QuickDice dice_;
  Stamp from_, to_; ///< of the current burst, or the next
  double share_ = 1;
};

/// Wheel or visual odometry: the true motion, step by step, with accumulating faults. Starts at identity. One owner.
class SyntheticOdometry {
 public:
  /// The trajectory must outlive it. The same arguments give the same samples.
  SyntheticOdometry(const Trajectory& trajectory, double rate_hz, const OdometryFaults& faults = {},
                    std::uint64_t seed = 1);

  OdometrySample next(); ///< starts at the start of the trajectory

 private:
  const Trajectory& trajectory_;
  Duration period_;
  OdometryFaults faults_;
  std::mt19937_64 random_;
  std::normal_distribution<double> normal_;
  Stamp stamp_; ///< of the next measurement
  SourceClock clock_;
  SlipBursts bursts_;
  Pose T_world_last_;
  Pose T_source_base_;
};

} // namespace locus::sim
