// SPDX-License-Identifier: Apache-2.0
#include "locus_sim/robot.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>

namespace locus::sim {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

const NamedWorld& world_called(std::string_view name) {
  return *std::find_if(kWorlds.begin(), kWorlds.end(), [&](const NamedWorld& world) { return world.name == name; });
}

TEST(Robots, EachRespectsTheSpeedLimitOfEachWorld) {
  for (const NamedWorld& named_world : kWorlds) {
    const World world = named_world.make(2);
    for (const NamedRobot& named : kRobots) {
      SCOPED_TRACE(std::string(named.name) + " in " + std::string(named_world.name));
      const Robot robot = named.make({}, 2);
      const Trajectory trajectory = drive_about(world, robot, seconds{120}, {}, 2);
      EXPECT_GT(trajectory.length_m(), 15);
      const double most_mps = std::min(robot.agility.cruise_mps, world.max_speed_mps);
      double fastest_mps = 0;
      for (Stamp t = trajectory.start(); t < trajectory.end(); t += milliseconds{100}) {
        const BaseMotion motion = trajectory.at(t);
        fastest_mps = std::max(fastest_mps, motion.velocity_world_mps.head<2>().norm());
        const Eigen::Vector3d middle = motion.T_world_base.translation + Eigen::Vector3d{0, 0, 0.3};
        // On stairs the middle of the lowest robot is 0.43 m above its path, and the noses of the steps rise 0.175 m
        // above that path, on a slope of 31.1 degrees; 1 cm allows for ripples.
        constexpr double kOnStairs_m = (0.43 - 0.175) * 0.856 - 0.01;
        ASSERT_GT(world.scene.distance_to_surface(middle, t), kOnStairs_m) << middle.transpose();
      }
      EXPECT_LT(fastest_mps, most_mps + 0.6); // plus the sway of a gait
    }
  }
}

TEST(Car, DrivesAt15MetresPerSecondForFiveMinutes) {
  const World road = world_called("road").make(1);
  const Robot car = make_car({}, 1);
  const Trajectory trajectory = drive_about(road, car, seconds{300}, {}, 1);
  double shaking_mps2 = 0;
  for (const Oscillation& oscillation : car.ride.oscillations)
    shaking_mps2 +=
        std::pow(2 * std::numbers::pi * oscillation.frequency_hz, 2) * oscillation.amplitude_m.head<2>().norm();
  EXPECT_GT(trajectory.length_m(), 300 * 10); // stops included
  int fast = 0, all = 0;
  for (Stamp t = trajectory.start(); t < trajectory.end(); t += milliseconds{50}, ++all) {
    const BaseMotion motion = trajectory.at(t);
    const Eigen::Vector2d velocity = motion.velocity_world_mps.head<2>();
    fast += velocity.norm() > 14;
    // The peak of an eased change of speed is 1.875 times its mean of 3 m/s^2.
    ASSERT_LT(motion.acceleration_world_mps2.head<2>().norm(), 1.875 * 3 + shaking_mps2);
    ASSERT_LT(velocity.norm() * std::abs(motion.angular_velocity_base_radps.z()), 3.5);
    ASSERT_GT(road.scene.distance_to_surface(motion.T_world_base.translation + Eigen::Vector3d{0, 0, 0.5}, t), 0.7);
  }
  EXPECT_GT(fast, 0.4 * all);
}

TEST(Handheld, HasOnlyAnImuAndSwaysAndTurnsFast) {
  const World plant = world_called("urban").make(1);
  const Robot robot = make_handheld({}, 1);
  EXPECT_TRUE(robot.sensors.odometry.empty());
  EXPECT_TRUE(robot.sensors.imu);
  const Trajectory trajectory = drive_about(plant, robot, seconds{180}, {}, 1);
  double fastest_radps = 0;
  int above_two = 0;
  for (Stamp t = trajectory.start(); t < trajectory.end(); t += milliseconds{10}) {
    const BaseMotion motion = trajectory.at(t);
    const double rate_radps = motion.angular_velocity_base_radps.norm();
    fastest_radps = std::max(fastest_radps, rate_radps);
    above_two += rate_radps > 2.5;
    const auto lidar = motion.T_world_base * robot.sensors.lidars.front().options.T_base_lidar;
    const Eigen::Vector3d& at = lidar.translation;
    const double above_ground_m = at.z() - plant.ground_m(at.x(), at.y()).value;
    ASSERT_GT(above_ground_m, 1.2);
    ASSERT_LT(above_ground_m, 1.7);
  }
  EXPECT_GT(fastest_radps, 3.5);
  EXPECT_LT(fastest_radps, 7); // a flick during a turn
  EXPECT_GT(above_two, 10);
  EXPECT_LT(above_two, 0.1 * 18'000);
}

/// Straight ahead, at walking pace.
TEST(Handheld, SwaysBy30CentimetresFromSideToSide) {
  const Trajectory trajectory(Course{}.change_speed(1.2, seconds{1}).straight(60), {}, {}, make_handheld({}, 1).ride);
  double leftmost_m = 0, rightmost_m = 0;
  for (Stamp t = trajectory.start() + seconds{5}; t < trajectory.start() + seconds{45}; t += milliseconds{10}) {
    const double left_m = trajectory.T_world_base(t).translation.y();
    leftmost_m = std::max(leftmost_m, left_m);
    rightmost_m = std::min(rightmost_m, left_m);
  }
  EXPECT_GT(leftmost_m - rightmost_m, 0.3);
  EXPECT_LT(leftmost_m - rightmost_m, 0.35); // plus the stride
}

TEST(Handheld, TurnsWithUpToTwoRadiansPerSecondAndFlicksWithFour) {
  const World plant = world_called("urban").make(1);
  Robot robot = make_handheld({}, 1);
  const Trajectory with_flicks = drive_about(plant, robot, seconds{180}, {}, 1);
  robot.agility.flicks_per_min = 0;
  const Trajectory without = drive_about(plant, robot, seconds{180}, {}, 1);
  double turn_radps = 0, flick_radps = 0;
  for (Stamp t = without.start(); t < without.end(); t += milliseconds{10}) {
    const double calm_radps = without.at(t).angular_velocity_base_radps.z();
    turn_radps = std::max(turn_radps, std::abs(calm_radps));
    flick_radps = std::max(flick_radps, std::abs(with_flicks.at(t).angular_velocity_base_radps.z() - calm_radps));
  }
  EXPECT_NEAR(turn_radps, 2, 0.2);
  EXPECT_GT(flick_radps, 3.5);
  EXPECT_LT(flick_radps, 4.2);
}

TEST(Handheld, MotionHasExactDerivativesInAFlick) {
  Ride ride;
  ride.flicks = {{seconds{1}, milliseconds{500}, {0.1, -0.2, 1}}, {seconds{3}, milliseconds{400}, {0, 0, -0.8}}};
  const Trajectory trajectory(Course{}.change_speed(1, seconds{1}).straight(4), {}, {}, ride);
  constexpr Duration kHalf = std::chrono::microseconds{50};
  for (Stamp t = trajectory.start() + milliseconds{3}; t < trajectory.end(); t += milliseconds{11}) {
    const auto before = trajectory.T_world_base(t - kHalf).rotation,
               after = trajectory.T_world_base(t + kHalf).rotation;
    const Eigen::Vector3d rate = so3_log(before.conjugate() * after) / to_seconds(2 * kHalf);
    ASSERT_LT((rate - trajectory.at(t).angular_velocity_base_radps).norm(), 1e-4);
  }
  const Pose in_flick = trajectory.T_world_base(trajectory.start() + milliseconds{1500});
  EXPECT_NEAR(to_rpy_rad(in_flick.rotation).z(), 1, 1e-9);
}

} // namespace
} // namespace locus::sim
