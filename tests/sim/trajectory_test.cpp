// SPDX-License-Identifier: Apache-2.0
#include "locus_sim/trajectory.hpp"

#include <gtest/gtest.h>

#include <numbers>
#include <stdexcept>

#include "locus_sim/synthetic_sources.hpp"

namespace locus::sim {
namespace {

using std::chrono::microseconds;
using std::chrono::milliseconds;
using std::chrono::seconds;

constexpr Terrain kRough{.height_m = 0.05, .tilt_rad = 0.03, .wavelength_m = 3};

Course winding() {
  return Course{}
      .stand(seconds{1})
      .change_speed(2, seconds{1})
      .straight(3)
      .turn(std::numbers::pi / 2, 2.0)
      .straight(2)
      .turn(-2.5, 1.0)
      .change_speed(0, seconds{1})
      .turn(std::numbers::pi, 2.0)
      .stand(seconds{1});
}

/// Compares the derivatives with finite differences of the pose.
void expect_exact_derivatives(const Trajectory& trajectory) {
  constexpr Duration kHalf = microseconds{50}; // short compared with the onset of a slip
  const double interval_s = to_seconds(2 * kHalf);
  for (Stamp t = trajectory.start() + milliseconds{7}; t < trajectory.end(); t += milliseconds{23}) {
    const BaseMotion before = trajectory.at(t - kHalf), now = trajectory.at(t), after = trajectory.at(t + kHalf);
    const Eigen::Vector3d velocity = (after.T_world_base.translation - before.T_world_base.translation) / interval_s;
    const Eigen::Vector3d acceleration = (after.velocity_world_mps - before.velocity_world_mps) / interval_s;
    const Eigen::Vector3d angular_velocity =
        so3_log(before.T_world_base.rotation.conjugate() * after.T_world_base.rotation) / interval_s;
    ASSERT_LT((velocity - now.velocity_world_mps).norm(), 1e-5);
    ASSERT_LT((acceleration - now.acceleration_world_mps2).norm(), 1e-4);
    ASSERT_LT((angular_velocity - now.angular_velocity_base_radps).norm(), 1e-5);
  }
}

TEST(Trajectory, DerivativesAreThoseOfThePose) { expect_exact_derivatives(Trajectory(winding(), {}, kRough)); }

TEST(Trajectory, DerivativesAreThoseOfThePoseOnHillsWithGaitAndSlip) {
  Ride legged;
  legged.ground_m = [](const Jet& x, const Jet& y) { return 0.4 * sin(0.5 * x) + 0.3 * cos(0.7 * y); };
  legged.oscillations = {{2.0, {0.01, 0.02, 0.03}, {0.03, 0.02, 0.01}, 0.5}, {5.0, {0, 0, 0.001}, {0, 0.005, 0}, 1}};
  legged.slips = {{milliseconds{2200}, milliseconds{2900}}, {seconds{4}, milliseconds{4200}}};
  expect_exact_derivatives(Trajectory(winding(), {}, kRough, legged));
}

TEST(Trajectory, AccelerationIsContinuous) {
  const Trajectory trajectory(winding(), {}, kRough);
  BaseMotion before = trajectory.at(trajectory.start());
  for (Stamp t = trajectory.start(); t < trajectory.end() + milliseconds{100}; t += milliseconds{1}) {
    const BaseMotion now = trajectory.at(t);
    ASSERT_LT((now.acceleration_world_mps2 - before.acceleration_world_mps2).norm(), 0.1);
    ASSERT_LT((now.angular_velocity_base_radps - before.angular_velocity_base_radps).norm(), 0.05);
    before = now;
  }
}

TEST(Trajectory, TurnsReachTwoRadiansPerSecond) {
  const Trajectory trajectory(winding());
  double peak_radps = 0;
  for (Stamp t = trajectory.start(); t < trajectory.end(); t += milliseconds{1})
    peak_radps = std::max(peak_radps, trajectory.at(t).angular_velocity_base_radps.z());
  EXPECT_NEAR(peak_radps, 2.0, 1e-9);
}

TEST(Trajectory, StandsStillBeforeAndAfterOnRoughGround) {
  const Trajectory trajectory(winding(), {}, kRough);
  const Pose start = trajectory.T_world_base(trajectory.start() - seconds{5});
  const Pose end = trajectory.T_world_base(trajectory.end() - milliseconds{1});
  EXPECT_EQ(start.translation, trajectory.T_world_base(trajectory.start() + milliseconds{990}).translation);
  EXPECT_LT((end.translation - trajectory.T_world_base(trajectory.end() + seconds{5}).translation).norm(), 1e-9);
}

TEST(Trajectory, SpeedOfFifteenMetresPerSecondLastsAThousandSeconds) {
  const Trajectory trajectory(Course{}.change_speed(15, Duration::zero()).straight(15'000));
  const Pose far = trajectory.T_world_base(trajectory.start() + seconds{700});
  EXPECT_NEAR(far.translation.x(), 10'500, 1e-6);
  EXPECT_NEAR(trajectory.length_m(), 15'000, 1e-6);
  EXPECT_EQ(trajectory.end() - trajectory.start(), seconds{1000});
}

TEST(Trajectory, CourseAlongWaypointsEndsAtTheLastOne) {
  const std::vector<Eigen::Vector2d> waypoints{{0, 0}, {10, 0}, {10, 8}, {2, 8}, {-5, 3}};
  const Trajectory trajectory(Course::along(waypoints, {.speed_mps = 1.5, .turn_rate_radps = 1.2}));
  const Pose end = trajectory.T_world_base(trajectory.end());
  EXPECT_LT((end.translation.head<2>() - waypoints.back()).norm(), 1e-6);
}

TEST(Trajectory, CourseThereAndBackReturnsAlongTheSamePath) {
  const Course out = winding();
  const Duration there = Trajectory(out).end() - Trajectory(out).start();
  const Trajectory trajectory(Course(out).back(2.0), {.position_m = {3, 4}, .heading_rad = 1});
  const Pose begin = trajectory.T_world_base(trajectory.start()), end = trajectory.T_world_base(trajectory.end());
  EXPECT_LT((end.translation - begin.translation).norm(), 1e-9);
  EXPECT_LT(angle_rad(begin.rotation.conjugate() * end.rotation), 1e-7);
  const Duration turning = (trajectory.end() - trajectory.start()) / 2 - there;
  for (Duration t{}; t < there; t += milliseconds{100}) {
    const BaseMotion on_way_out = trajectory.at(trajectory.start() + t);
    const BaseMotion on_way_back = trajectory.at(trajectory.end() - turning - t);
    ASSERT_LT((on_way_out.T_world_base.translation - on_way_back.T_world_base.translation).norm(), 1e-6);
    ASSERT_LT((on_way_out.velocity_world_mps + on_way_back.velocity_world_mps).norm(), 1e-6);
  }
}

TEST(Trajectory, LegTooShortForItsTurnsIsAnError) {
  EXPECT_THROW(Course::along({{0, 0}, {10, 0}, {10, 1}, {0, 1}}, {.speed_mps = 2, .turn_rate_radps = 0.5}),
               std::invalid_argument);
}

TEST(SyntheticImu, GyroIntegratesToTheTrueRotation) {
  const Trajectory trajectory(winding(), {}, kRough);
  SyntheticImu imu(trajectory, 1000);
  Eigen::Quaterniond rotation = trajectory.T_world_base(trajectory.start()).rotation;
  ImuSample last = imu.next();
  for (ImuSample now = imu.next(); now.stamp <= trajectory.end(); now = imu.next()) {
    const Eigen::Vector3d mean = (last.angular_velocity_radps + now.angular_velocity_radps) / 2;
    rotation = (rotation * so3_exp(to_seconds(now.stamp - last.stamp) * mean)).normalized();
    ASSERT_LT(angle_rad(rotation.conjugate() * trajectory.T_world_base(now.stamp).rotation), 1e-5);
    last = now;
  }
}

TEST(SyntheticImu, SpecificForceIntegratesToTheTrueVelocity) {
  const Trajectory trajectory(winding(), {}, kRough);
  SyntheticImu imu(trajectory, 1000);
  EXPECT_NEAR(imu.next().specific_force_mps2.norm(), kGravity_mps2, 1e-9);
  Eigen::Vector3d velocity = Eigen::Vector3d::Zero();
  for (ImuSample now = imu.next(); now.stamp <= trajectory.end(); now = imu.next()) {
    velocity += 1e-3 * (*now.attitude * now.specific_force_mps2 - Eigen::Vector3d{0, 0, kGravity_mps2});
    ASSERT_LT((velocity - trajectory.at(now.stamp).velocity_world_mps).norm(), 0.02);
  }
}

TEST(SyntheticOdometry, WithoutFaultsEqualsTheTruthRelativeToItsStart) {
  const Trajectory trajectory(winding(), {.position_m = {3, 4}, .heading_rad = 1}, kRough);
  const Pose T_source_world = trajectory.T_world_base(trajectory.start()).inverse();
  SyntheticOdometry odometry(trajectory, 50);
  for (OdometrySample now = odometry.next(); now.stamp <= trajectory.end(); now = odometry.next()) {
    const Pose error = now.T_source_base.inverse() * (T_source_world * trajectory.T_world_base(now.stamp));
    ASSERT_LT(error.translation.norm(), 1e-9);
    ASSERT_LT(angle_rad(error.rotation), 1e-7);
  }
}

TEST(SyntheticOdometry, ScaleErrorLengthensTheDistance) {
  const Trajectory trajectory(Course{}.change_speed(1, Duration::zero()).straight(10));
  SyntheticOdometry odometry(trajectory, 50, {.scale_error = 0.1});
  OdometrySample last = odometry.next();
  while (last.stamp < trajectory.end())
    last = odometry.next();
  EXPECT_NEAR(last.T_source_base.translation.x(), 11, 1e-6);
}

} // namespace
} // namespace locus::sim
