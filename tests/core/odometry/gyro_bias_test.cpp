// SPDX-License-Identifier: Apache-2.0
#include "core/odometry/gyro_bias.hpp"

#include <gtest/gtest.h>

#include <random>

namespace locus {
namespace {

constexpr Duration kSweep = std::chrono::milliseconds{100};
const Eigen::Vector3d kBias_radps{0.001, -0.004, 0.008};

/// What is left to learn of a sweep in which lidar is off by 0.02 deg.
void learn(GyroBias& bias, const Eigen::Vector3d& true_turn_rad, std::mt19937& random) {
  std::normal_distribution<double> lidar_noise_rad(0.0, 0.00035);
  Eigen::Vector3d excess_rad = to_seconds(kSweep) * kBias_radps - bias.turn_rad(kSweep);
  for (double& axis : excess_rad)
    axis += lidar_noise_rad(random);
  bias.learn(excess_rad, true_turn_rad, kSweep);
}

TEST(GyroBias, IsLearnedInAFewSecondsOfStanding) {
  GyroBias bias;
  std::mt19937 random{1};
  for (int sweep = 0; sweep < 100; ++sweep)
    learn(bias, Eigen::Vector3d::Zero(), random);
  EXPECT_LT((bias.turn_rad(std::chrono::seconds{1}) - kBias_radps).norm(), 0.0015);
  for (int sweep = 0; sweep < 500; ++sweep)
    learn(bias, Eigen::Vector3d::Zero(), random);
  EXPECT_LT((bias.turn_rad(std::chrono::seconds{1}) - kBias_radps).norm(), 0.0005);
}

TEST(GyroBias, FastTurnsTeachNothingForTheyShowTheErrorOfTheScale) {
  GyroBias bias;
  for (int sweep = 0; sweep < 100; ++sweep)
    bias.learn({0, 0, 0.001}, {0, 0, 0.1}, kSweep);
  EXPECT_TRUE(bias.turn_rad(kSweep).isZero());
}

TEST(GyroBias, ATimeThatDoesNotPassTeachesNothing) {
  GyroBias bias;
  bias.learn({0, 0, 0.001}, Eigen::Vector3d::Zero(), Duration::zero());
  EXPECT_TRUE(bias.turn_rad(kSweep).isZero());
}

} // namespace
} // namespace locus
