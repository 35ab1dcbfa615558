// SPDX-License-Identifier: Apache-2.0
#include "core/odometry/gyro_scale.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "core/base/pose.hpp"

namespace locus {
namespace {

const Eigen::Vector3d kTurn_rad{0.0, 0.0, kRadPerDeg};
constexpr Eigen::Index kYaw = 2, kRoll = 0;

double relative_sigma(const GyroScale& scale, Eigen::Index axis) {
  return std::sqrt(scale.variance(Eigen::Vector3d::Ones())[axis]);
}

TEST(GyroScale, OfAGyroThatHasNotTurnedAllMayBeWrong) {
  EXPECT_DOUBLE_EQ(relative_sigma(GyroScale{}, kYaw), 1.0);
  EXPECT_TRUE(GyroScale{}.variance(Eigen::Vector3d::Zero()).isZero()) << "what does not turn is not wrong about it";
}

TEST(GyroScale, TurnsThatLidarSeesTooAreBelievedSoonAboutTheirAxis) {
  GyroScale scale;
  const Eigen::Vector3d noise_rad = Eigen::Vector3d::Constant(0.1 * kRadPerDeg);
  for (int i = 0; i < 5; ++i)
    scale.learn(noise_rad, kTurn_rad);
  EXPECT_LT(relative_sigma(scale, kYaw), 0.1);
  EXPECT_DOUBLE_EQ(relative_sigma(scale, kRoll), 1.0);
}

TEST(GyroScale, AGyroThatTurnsTheOtherWayIsNotBelieved) {
  GyroScale scale;
  for (int i = 0; i < 5; ++i)
    scale.learn(2.0 * kTurn_rad, kTurn_rad);
  EXPECT_NEAR(relative_sigma(scale, kYaw), 2.0, 0.1);
}

} // namespace
} // namespace locus
