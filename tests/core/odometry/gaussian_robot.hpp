// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <optional>
#include <random>
#include <utility>
#include <vector>

#include "core/odometry/motion_filter.hpp"
#include "core/sources/motion_sample.hpp"

namespace locus::test {

inline constexpr SourceId kWheelSource{0}, kGyroSource{1};
inline constexpr int kX = 0, kYaw = 5;
inline constexpr std::array kRates_hz{5.0, 10.0, 20.0};
inline constexpr double kLearned = 1.5 * 1.5; ///< bound on the ratio of a learned variance to the true one
inline constexpr double kSigmas = 4.0;        ///< a Gaussian exceeds this once in 16 000

inline constexpr MotionFilter::Measured kNothing{.translation = false, .rotation = false};
inline constexpr MotionFilter::Measured kTranslation{.translation = true, .rotation = false};
inline constexpr MotionFilter::Measured kRotation{.translation = false, .rotation = true};
inline constexpr MotionFilter::Measured kAll{.translation = true, .rotation = true};

/// Priors of the filter for the source noise: translation (m) and rotation (rad), standard deviation after one second.
inline const Vector6 kUsualWheels = along_each_axis(0.02, 0.01 / kRadPerDeg);
inline const Vector6 kUsualGyro = along_each_axis(0.0, 0.006 / kRadPerDeg);

inline std::vector<MotionSourceOptions> wheels_and_gyro() {
  return {{.name = "wheels", .kind = SourceKind::odometry, .T_base_source = {}},
          {.name = "gyro", .kind = SourceKind::imu, .T_base_source = {}}};
}

inline Vector6 twist_of(double vx, double vy, double vz, double wx, double wy, double wz) {
  return (Vector6() << vx, vy, vz, wx, wy, wz).finished();
}

using Motion = std::function<Vector6(double t_s)>; ///< twist of the base, base axes

inline Motion straight(double speed_mps) {
  return [=](double) { return twist_of(speed_mps, 0, 0, 0, 0, 0); };
}

inline Vector6 winding(double t) {
  return twist_of(1.5 + 0.5 * std::sin(0.7 * t), 0.05 * std::sin(1.3 * t), 0.03 * std::sin(1.1 * t),
                  0.05 * std::sin(2.0 * t), 0.05 * std::sin(1.7 * t), 0.3 * std::sin(0.5 * t));
}

/// Slow motion, for which errors proportional to it are negligible.
inline Vector6 creeping(double t) { return 0.1 * winding(t); }

/// A robot with this true motion. Its sensors have Gaussian noise, bias, scale error, lateness and misalignment only.
class GaussianRobot {
 public:
  struct Sensors {
    Vector6 wheels = kUsualWheels, gyro = kUsualGyro; ///< standard deviation of translation and rotation after 1 s
    double scale = 0.0;                               ///< error of the forward distance, as a ratio
    double to_the_left = 0.0, upwards = 0.0;          ///< lateral and vertical error, as ratios of the forward distance
    std::function<double(double t_s)> slip_mps{};     ///< wheel speed in excess of the rolling speed
    Eigen::Vector3d bias_radps = Eigen::Vector3d::Zero();
    double late_s = 0.0;                                    ///< of the gyro's stamps
    Eigen::Vector3d mounting_rad = Eigen::Vector3d::Zero(); ///< misalignment of the gyro
    double force_mps = 0.02;                                ///< standard deviation of the speed after 1 s
    Eigen::Vector3d force_bias_mps2 = Eigen::Vector3d::Zero();
    Eigen::Vector3d lever_m = Eigen::Vector3d::Zero(); ///< from the base to the accelerometer
  };

  GaussianRobot(Motion motion, Sensors sensors, unsigned seed)
      : motion_(std::move(motion)), sensors_(std::move(sensors)), random_(seed) {}

  void move(double elapsed_s) {
    constexpr int kParts = 40;
    const Pose T_odom_last = T_odom_base_;
    const double part_s = elapsed_s / kParts;
    elapsed_s_ = elapsed_s;
    force_.setZero();
    for (int i = 0; i < kParts; ++i) {
      const double t = t_s_ + (i + 0.5) * part_s;
      const Vector6 twist = motion_(t);
      const Vector6 rate = (motion_(t + 0.5 * part_s) - motion_(t - 0.5 * part_s)) / part_s;
      const Eigen::Quaterniond R_odom_base = T_odom_base_.rotation * so3_exp(0.5 * part_s * twist.tail<3>());
      const Eigen::Vector3d of_lever =
          rate.tail<3>().cross(sensors_.lever_m) + twist.tail<3>().cross(twist.tail<3>().cross(sensors_.lever_m));
      const Eigen::Vector3d inertial = rate.head<3>() + twist.tail<3>().cross(twist.head<3>()) + of_lever;
      force_ += (inertial + R_odom_base.conjugate() * (kGravity_mps2 * Eigen::Vector3d::UnitZ())) / kParts;
      T_odom_base_ = T_odom_base_ * se3_exp(part_s * twist);
    }
    t_s_ += elapsed_s;
    twist_ = se3_log(T_odom_last.inverse() * T_odom_base_) / elapsed_s;
  }

  [[nodiscard]] const Pose& pose() const { return T_odom_base_; }
  [[nodiscard]] const Vector6& twist() const { return twist_; } ///< mean since the previous step
  [[nodiscard]] double t_s() const { return t_s_; }

  Vector6 wheels() {
    Vector6 said = noisy(twist_, sensors_.wheels / std::sqrt(elapsed_s_));
    said.head<3>() += twist_[kX] * Eigen::Vector3d{sensors_.scale, sensors_.to_the_left, sensors_.upwards};
    said[kX] += sensors_.slip_mps ? sensors_.slip_mps(t_s_ - 0.5 * elapsed_s_) : 0.0;
    return said;
  }
  /// Measures the rotation; the stamps are corrected by `taken_out_s` of the lateness.
  SensedTwist gyro(double taken_out_s = 0.0) {
    const Eigen::Quaterniond askew = so3_exp(-sensors_.mounting_rad);
    const double late_s = sensors_.late_s - taken_out_s, moment_s = to_seconds(SourcePose::kMoment);
    const auto at_end = [&](double end_s) {
      return noisy(mean_of_motion(end_s - moment_s, end_s), sensors_.gyro / std::sqrt(moment_s));
    };
    const Vector6 began = at_end(t_s_ - elapsed_s_ - late_s), ended = at_end(t_s_ - late_s);
    const Vector6 mean = late_s == 0.0 ? twist_ : mean_of_motion(t_s_ - elapsed_s_ - late_s, t_s_ - late_s);
    SensedTwist said(noisy(mean, sensors_.gyro / std::sqrt(elapsed_s_)));
    said.mean.head<3>().setZero();
    said.mean.tail<3>() = askew * said.mean.tail<3>() + sensors_.bias_radps;
    said.change_per_s.tail<3>() = askew * (ended - began).tail<3>() / elapsed_s_;
    said.brought_forward = taken_out_s * said.change_per_s;
    return said;
  }
  SpecificForce force() {
    const Vector6 sigma = along_each_axis(sensors_.force_mps, 0.0) / std::sqrt(elapsed_s_);
    const Eigen::Vector3d mean = force_ + sensors_.force_bias_mps2 + noisy(Vector6::Zero(), sigma).head<3>();
    return {.early_base_mps2 = mean, .late_base_mps2 = mean, .source = kGyroSource};
  }
  /// Returns the true pose and twist relative to the belief, with the noise of a lidar of this information.
  Vector12 seen_beside(const MotionBelief& belief, const Matrix12& information) {
    Vector12 off;
    off << difference(T_odom_base_, belief.T_target_source), twist_ - belief.twist_base;
    for (int i = 0; i < 12; ++i)
      off[i] += information(i, i) > 0.0 ? normal_(random_) / std::sqrt(information(i, i)) : 0.0;
    return off;
  }

 private:
  [[nodiscard]] Vector6 mean_of_motion(double from_s, double to_s) const {
    constexpr int kParts = 20;
    Vector6 sum = Vector6::Zero();
    for (int i = 0; i < kParts; ++i)
      sum += motion_(from_s + (i + 0.5) / kParts * (to_s - from_s));
    return sum / kParts;
  }
  Vector6 noisy(Vector6 value, const Vector6& sigma) {
    for (int i = 0; i < 6; ++i)
      value[i] += sigma[i] * normal_(random_);
    return value;
  }

  Motion motion_;
  Sensors sensors_;
  std::mt19937 random_;
  std::normal_distribution<double> normal_;
  Pose T_odom_base_;
  Vector6 twist_ = Vector6::Zero();
  Eigen::Vector3d force_ = Eigen::Vector3d::Zero();
  double t_s_ = 0.0, elapsed_s_ = 0.0;
};

/// Information of a lidar with these standard deviations of the pose and twist of a sweep, along each axis.
inline Matrix12 lidar_with(const Vector6& pose_sigma, const Vector6& twist_sigma) {
  Vector12 sigma;
  sigma << pose_sigma, twist_sigma;
  return sigma.cwiseAbs2().cwiseInverse().asDiagonal();
}
/// Information of an ordinary lidar: its points determine the pose to 5 mm and 1 mrad, and their spread of ages
/// determines the twist to three times that, divided by the sweep's period.
inline Matrix12 usual_lidar(double period_s) {
  const Vector6 pose = along_each_axis(0.005, 0.001 / kRadPerDeg);
  return lidar_with(pose, 3.0 / period_s * pose);
}
inline Matrix12 blind_ahead(Matrix12 information) {
  for (const int axis : {kX, 6 + kX}) {
    information.row(axis).setZero();
    information.col(axis).setZero();
  }
  return information;
}

/// Updates as a registration does: fuses the belief and the points by their information.
inline void see(MotionFilter& filter, GaussianRobot& robot, const Matrix12& information) {
  const MotionBelief belief = filter.belief();
  const Vector12 off = robot.seen_beside(belief, information);
  const Vector12 step = (belief.information + information).ldlt().solve(information * off);
  const Eigen::Vector3d turn = step.segment<3>(3);
  filter.update({(so3_exp(turn) * belief.T_target_source.rotation).normalized(),
                 belief.T_target_source.translation + step.head<3>()},
                belief.twist_base + step.tail<6>(), information);
}

struct Sensing {
  bool wheels = true, gyro = true, force = false;
  std::optional<Matrix12> lidar = std::nullopt;
};

/// Simulates and processes one sweep.
inline void sweep(MotionFilter& filter, GaussianRobot& robot, double elapsed_s, const Sensing& sensing) {
  robot.move(elapsed_s);
  filter.predict(elapsed_s, elapsed_s, sensing.force ? std::optional(robot.force()) : std::nullopt,
                 {.translation = sensing.wheels, .rotation = sensing.wheels || sensing.gyro});
  if (sensing.gyro)
    filter.measure(kGyroSource, robot.gyro(), kRotation);
  if (sensing.wheels)
    filter.measure(kWheelSource, robot.wheels(), sensing.gyro ? kTranslation : kAll);
  filter.move();
  if (sensing.lidar)
    see(filter, robot, *sensing.lidar);
  filter.learn();
}

inline void sweep_for(double time_s, MotionFilter& filter, GaussianRobot& robot, double elapsed_s,
                      const Sensing& sensing) {
  const auto count = static_cast<int>(std::lround(time_s / elapsed_s));
  for (int i = 0; i < count; ++i)
    sweep(filter, robot, elapsed_s, sensing);
}

inline MotionFilter begun(const Vector6& twist, const Vector6& sigma = along_each_axis(0.05, 1.0)) {
  MotionFilter filter(wheels_and_gyro());
  filter.begin(Pose{}, twist, sigma);
  return filter;
}
inline MotionFilter begun_with(const GaussianRobot& robot, const Motion& motion) { return begun(motion(robot.t_s())); }

inline Vector12 error_of(const MotionFilter& filter, const GaussianRobot& robot) {
  Vector12 error;
  error << difference(robot.pose(), filter.pose()), robot.twist() - filter.twist_base();
  return error;
}

/// Normalised estimation error squared, per dimension.
inline double nees(const MotionFilter& filter, const GaussianRobot& robot) {
  const Vector12 error = error_of(filter, robot);
  return error.dot(filter.covariance().ldlt().solve(error)) / 12.0;
}

inline double sigma_of(const MotionFilter& filter, int axis) { return std::sqrt(filter.covariance()(axis, axis)); }

/// Returns the part of an innovation's variance that is the source's own noise: variance of translation or rotation
/// after one second.
inline Vector6 noise_of(const MotionFilter& filter, SourceId source, const Vector6& said, double elapsed_s) {
  const Innovation found = filter.innovation(source, said);
  return (found.variance - found.others - found.known) * elapsed_s;
}

inline bool is_sound(const Matrix12& covariance) {
  const double most = std::max(1.0, covariance.cwiseAbs().maxCoeff());
  return covariance.allFinite() && (covariance - covariance.transpose()).cwiseAbs().maxCoeff() <= 1e-12 * most &&
         Eigen::SelfAdjointEigenSolver<Matrix12>(covariance).eigenvalues()[0] > -std::max(1e-9, 1e-14 * most);
}

} // namespace locus::test
