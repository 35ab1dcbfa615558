// SPDX-License-Identifier: Apache-2.0
#include "core/odometry/standstill.hpp"

#include <gtest/gtest.h>

#include <random>

namespace locus {
namespace {

using std::chrono::milliseconds;

Pose at(double x_m, double yaw_rad = 0.0) { return {so3_exp({0, 0, yaw_rad}), {x_m, 0, 0}}; }
Stamp sweep(int number) { return stamp_from_ns(1'000'000'000) + number * milliseconds{100}; }

/// A robot that has stood for two seconds at the origin.
Standstill standing() {
  Standstill standstill;
  for (int i = -20; i < 0; ++i)
    standstill.observe(sweep(i), at(0.0), false);
  return standstill;
}

TEST(Standstill, TakesASecondToBeSureOf) {
  Standstill standstill;
  for (int i = 0; i < 10; ++i)
    EXPECT_FALSE(standstill.observe(sweep(i), at(0.0), false)) << i;
  EXPECT_TRUE(standstill.observe(sweep(10), at(0.0), false));
}

TEST(Standstill, HoldsThePoseThroughTheNoiseOfLidarHoweverLong) {
  Standstill standstill = standing();
  std::mt19937 random{1};
  std::normal_distribution<double> noise_m(0.0, 0.002), noise_rad(0.0, 0.0003);
  for (int i = 0; i < 18'000; ++i) {
    const std::optional<Pose> held = standstill.observe(sweep(i), at(noise_m(random), noise_rad(random)), false);
    ASSERT_TRUE(held) << "after " << i << " sweeps";
    ASSERT_EQ(held->translation.x(), 0.0);
  }
}

TEST(Standstill, EndsInTheSweepInWhichTheRobotDrivesOff) {
  EXPECT_FALSE(standing().observe(sweep(0), at(0.015), false));
  EXPECT_FALSE(standing().observe(sweep(0), at(0.0, 0.003), false));
  EXPECT_FALSE(standing().observe(sweep(0), at(0.001), true)) << "wheels tell before lidar is sure";
}

TEST(Standstill, ARobotThatCreepsIsNotStanding) {
  Standstill standstill;
  for (int i = 0; i < 600; ++i) // 2 cm/s
    EXPECT_FALSE(standstill.observe(sweep(i), at(0.002 * i), false)) << i;
}

TEST(Standstill, IsNotKnownWithoutLidar) {
  Standstill standstill = standing();
  standstill.lose_sight();
  EXPECT_FALSE(standstill.observe(sweep(0), at(0.0), false));
}

} // namespace
} // namespace locus
