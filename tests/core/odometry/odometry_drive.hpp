// SPDX-License-Identifier: Apache-2.0
// Robots and drives of the tests of the odometry.
#pragma once

#include <Eigen/Eigenvalues>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstddef>
#include <cstdio>
#include <numbers>
#include <string>
#include <vector>

#include "core/odometry/odometry.hpp"
#include "core/robot.hpp"
#include "locus_sim/trajectory.hpp"

namespace locus::test {

/// Wheels with 0.5 % slip and a yaw drift, and a gyro with noise.
inline RobotSetup robot_with_wheels_and_imu() {
  RobotSetup setup;
  setup.lidars.front().range_noise_m = 0.02;
  setup.wheels = sim::OdometryFaults{.scale_error = 0.005, .yaw_drift_rad_per_m = 0.002};
  setup.imu = sim::ImuFaults{.gyro_noise_radps = 0.002, .accelerometer_noise_mps2 = 0.02};
  return setup;
}

inline RobotSetup robot_with_lidar_alone() {
  RobotSetup setup;
  setup.lidars.front().range_noise_m = 0.02;
  return setup;
}

/// 30 m along x, a half turn at 2 rad/s, and back.
inline sim::Trajectory sixty_metres(const sim::Start& start) {
  sim::Course course;
  for (int way = 0; way < 2; ++way)
    course.stand(seconds{1})
        .change_speed(2.0, seconds{2})
        .straight(26)
        .change_speed(0.0, seconds{2})
        .turn(std::numbers::pi, 2.0);
  return sim::Trajectory(course, start);
}

struct Outcome {
  std::vector<OdometryEstimate> estimates;
  double worst_error_m = 0.0; ///< against the truth, from the first estimate on
  double worst_error_deg = 0.0;
  std::size_t failed = 0;
};

inline Outcome drive_through(const sim::Scene& scene, const sim::Trajectory& trajectory, const RobotSetup& setup,
                             Duration duration) {
  Odometry odometry(setup.odometry(), setup.motion_sources());
  Outcome result;
  drive(scene, trajectory, setup, duration, [&](const Sweep& sweep) {
    const OdometryEstimate& estimate = result.estimates.emplace_back(odometry.process(sweep));
    const Pose truth = true_motion(trajectory, result.estimates.front().stamp, estimate.stamp);
    const Pose error = truth.inverse() * (result.estimates.front().T_odom_base.inverse() * estimate.T_odom_base);
    result.worst_error_m = std::max(result.worst_error_m, error.translation.norm());
    result.worst_error_deg = std::max(result.worst_error_deg, angle_rad(error.rotation) / kRadPerDeg);
    result.failed += estimate.failed ? 1 : 0;
  });
  testing::Test::RecordProperty("worst_error_mm", std::to_string(1e3 * result.worst_error_m));
  std::printf("%zu sweeps, %zu failed, worst error %.1f mm %.2f deg\n", result.estimates.size(), result.failed,
              1e3 * result.worst_error_m, result.worst_error_deg);
  return result;
}

inline bool is_covariance(const Matrix6& m) {
  return m.allFinite() && (m - m.transpose()).cwiseAbs().maxCoeff() < 1e-9 * m.cwiseAbs().maxCoeff() &&
         Eigen::SelfAdjointEigenSolver<Matrix6>(m).eigenvalues()[0] > 0.0;
}

inline void expect_sound(const std::vector<OdometryEstimate>& estimates) {
  for (std::size_t i = 0; i < estimates.size(); ++i) {
    const OdometryEstimate& e = estimates[i];
    ASSERT_TRUE(e.T_odom_base.finite());
    ASSERT_NEAR(e.T_odom_base.rotation.norm(), 1.0, 1e-9);
    ASSERT_TRUE(e.twist_base.allFinite());
    ASSERT_TRUE(e.pose_covariance.allFinite());
    ASSERT_TRUE(e.twist_covariance.allFinite());
    if (i == 0)
      continue;
    ASSERT_GT(e.stamp, estimates[i - 1].stamp);
    ASSERT_TRUE(is_covariance(e.pose_covariance)) << "estimate " << i;
    ASSERT_TRUE(is_covariance(e.twist_covariance)) << "estimate " << i;
  }
}

} // namespace locus::test
