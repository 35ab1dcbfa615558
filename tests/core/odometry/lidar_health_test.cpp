// SPDX-License-Identifier: Apache-2.0
#include "core/odometry/lidar_health.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace locus {
namespace {

constexpr std::size_t kPoints = 1000;
constexpr double kPeriod_s = 0.1;

Registration fit(std::size_t inliers, double mean_error = 1.0, std::size_t points = kPoints) {
  Registration registration;
  registration.points = points;
  registration.inliers = inliers;
  registration.mean_error = mean_error;
  return registration;
}

/// A lidar health monitor after two seconds of this registration.
LidarHealth used_to(const Registration& registration, double period_s = kPeriod_s) {
  LidarHealth health;
  for (int i = 0; i < static_cast<int>(2.0 / period_s); ++i)
    health.learn(registration, period_s);
  return health;
}

TEST(LidarHealth, NothingIsUnusualBeforeTheFirstSweep) {
  const LidarHealth health;
  EXPECT_FALSE(health.lacks_correspondences(fit(0)));
  EXPECT_FALSE(health.is_unusual(fit(0)));
}

TEST(LidarHealth, FirstSweepSetsTheUsual) {
  LidarHealth health;
  health.learn(fit(900), kPeriod_s);
  EXPECT_TRUE(health.lacks_correspondences(fit(449)));
  EXPECT_FALSE(health.lacks_correspondences(fit(451)));
}

TEST(LidarHealth, LacksCorrespondencesBelowHalfOfTheUsualShare) {
  const LidarHealth health = used_to(fit(600));
  EXPECT_TRUE(health.lacks_correspondences(fit(299)));
  EXPECT_FALSE(health.lacks_correspondences(fit(301)));
  EXPECT_FALSE(health.lacks_correspondences(fit(31, 1.0, kPoints / 10))) << "a share, whatever the number of points";
}

TEST(LidarHealth, FitWorseByASeventhIsUnusual) {
  const LidarHealth health = used_to(fit(800, 1.0));
  EXPECT_FALSE(health.is_unusual(fit(800, 1.0)));
  EXPECT_TRUE(health.is_unusual(fit(679, 1.0))) << "fewer";
  EXPECT_FALSE(health.is_unusual(fit(681, 1.0)));
  EXPECT_TRUE(health.is_unusual(fit(800, 2.21))) << "farther off";
  EXPECT_FALSE(health.is_unusual(fit(800, 2.19)));
  EXPECT_FALSE(health.is_unusual(fit(80, 1.0, kPoints / 10)));
}

TEST(LidarHealth, PointsFitByChanceIfSpreadEvenlyAndUnusual) {
  const LidarHealth health = used_to(fit(800, 1.0));
  EXPECT_TRUE(health.is_by_chance(fit(800, 2.3)));
  EXPECT_FALSE(health.is_by_chance(fit(600, 2.0))) << "unusual, but on their surfaces";
  EXPECT_FALSE(used_to(fit(800, 2.3)).is_by_chance(fit(800, 2.3))) << "as usual";
}

/// No lidar is rejected for good.
TEST(LidarHealth, FitByChanceThatLastsFiveSecondsBecomesUsual) {
  LidarHealth health = used_to(fit(800, 1.0));
  const auto reject_for_s = [&](double duration_s) {
    for (int i = 0; i < static_cast<int>(std::lround(duration_s / kPeriod_s)); ++i)
      health.forgive(fit(800, 3.0), kPeriod_s);
  };
  reject_for_s(1.0);
  EXPECT_TRUE(health.is_by_chance(fit(800, 3.0)));
  reject_for_s(4.0);
  EXPECT_FALSE(health.is_by_chance(fit(800, 3.0)));
}

TEST(LidarHealth, AdaptsToANewPlaceInSecondsAtAnyRate) {
  for (const double period_s : {0.2, 0.1, 0.05}) {
    LidarHealth health = used_to(fit(1000), period_s);
    EXPECT_TRUE(health.lacks_correspondences(fit(400)));
    for (int i = 0; i < static_cast<int>(std::lround(1.0 / period_s)); ++i)
      health.learn(fit(400), period_s);
    EXPECT_FALSE(health.lacks_correspondences(fit(400)));
    const double left = std::exp(-1.0), usual = 400 + 600 * left;
    EXPECT_FALSE(health.lacks_correspondences(fit(static_cast<std::size_t>(0.5 * usual) + 1))) << period_s;
    const double least_left = std::pow(0.8, 5), least = 400 + 600 * least_left;
    EXPECT_TRUE(health.lacks_correspondences(fit(static_cast<std::size_t>(0.5 * least) - 1))) << period_s;
  }
}

TEST(LidarHealth, EmptySweepDoesNotDivideByZero) {
  LidarHealth health;
  health.learn(fit(0, 1.0, 0), 0.0);
  health.learn(fit(0, 1.0, 0), kPeriod_s);
  EXPECT_FALSE(health.lacks_correspondences(fit(0, 1.0, 0)));
  EXPECT_FALSE(health.is_unusual(fit(0, 1.0, 0)));
  health = used_to(fit(800));
  EXPECT_TRUE(health.lacks_correspondences(fit(0, 1.0, 0)));
}

} // namespace
} // namespace locus
