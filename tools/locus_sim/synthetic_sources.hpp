// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <random>

#include "core/sources/motion_sample.hpp"
#include "locus_sim/quick_dice.hpp"
#include "locus_sim/trajectory.hpp"

namespace locus::sim {

/// What is wrong with the stamps of a source.
struct StampFaults {
  Duration late{};     ///< than what was measured
  double jitter_s = 0; ///< standard deviation of each
};

/// The stamps that a source puts on what it measures: they never stand still nor run backwards. One owner.
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

/// Faults of an inertial measurement unit; as it stands, a perfect one.
struct ImuFaults {
  StampFaults stamps{};
  Eigen::Vector3d gyro_bias_radps = Eigen::Vector3d::Zero();
  double gyro_noise_radps = 0;                                     ///< standard deviation of a sample
  double gyro_bias_walk_radps_per_sqrt_s = 0;                      ///< random walk of the bias
  double gyro_scale_error = 0;                                     ///< 0.002: it shows 0.2 % too much
  Eigen::Vector3d gyro_axis_scale_error = Eigen::Vector3d::Zero(); ///< the same of each axis, on top
  /// rad/s for each m/s^2 of specific force, against what it was at rest where the trajectory starts: there the gyro
  /// was calibrated.
  Eigen::Matrix3d gyro_g_sensitivity_sm = Eigen::Matrix3d::Zero();
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
  Eigen::Vector3d force_at_rest_mps2_; ///< where the trajectory starts
  std::mt19937_64 random_;
  std::normal_distribution<double> normal_;
  Stamp stamp_; ///< of what is measured next
  SourceClock clock_;
};

/// Faults of an odometry source; as it stands, a perfect one.
struct OdometryFaults {
  StampFaults stamps{};
  double scale_error = 0;          ///< 0.02: it reports 2 % more metres than were driven (slip, tyre pressure)
  double yaw_drift_rad_per_m = 0;  ///< it veers to the left of what was driven
  double noise_m_per_sqrt_m = 0;   ///< random walk of the position over the distance
  double noise_rad_per_sqrt_m = 0; ///< random walk of the heading over the distance
  double yaw_drift_rad_per_s = 0;  ///< it turns to the left even where the robot stands
  double turn_error = 0;           ///< 0.02: it reports turns 2 % too large
  double turn_slip_m_per_rad = 0;  ///< metres ahead that were not driven, for every radian turned (skidding wheels)
  double climb_m_per_sqrt_m = 0;   ///< random walk of the height over the distance
  double spinning_mps = 0;         ///< that it reports while wheels or feet slip; 0: it does not feel them
  double slip_bursts_per_min = 0;  ///< moments in which it reports more motion ahead than there is, braking less
};

/// Moments in which wheels or feet slip while the robot moves on, at random times, for half a second to two. One owner.
class SlipBursts {
 public:
  /// The trajectory must outlive it.
  SlipBursts(const Trajectory& trajectory, double per_min, std::uint64_t seed);

  /// Motion ahead that is reported, for each metre that is driven; to be asked in order of time.
  double reported_share(Stamp stamp);

 private:
  void draw(Stamp after);

  const Trajectory& trajectory_;
  double per_min_;
  QuickDice dice_;
  Stamp from_, to_; ///< of the present one, or the next
  double share_ = 1;
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
  Stamp stamp_; ///< of what is measured next
  SourceClock clock_;
  SlipBursts bursts_;
  Pose T_world_last_;
  Pose T_source_base_;
};

} // namespace locus::sim
