// SPDX-License-Identifier: Apache-2.0
#include "core/odometry/flat_ground.hpp"

#include <gtest/gtest.h>

#include <optional>

namespace locus {
namespace {

Eigen::Vector3d up_at_pitch_deg(double pitch_deg) {
  return from_rpy_rad({0, pitch_deg * kRadPerDeg, 0}).conjugate() * Eigen::Vector3d::UnitZ();
}
const Eigen::Vector3d kLevel = up_at_pitch_deg(0.0);
Stamp at(int sweep) { return stamp_from_ns(1'000'000'000) + sweep * std::chrono::milliseconds{100}; }

TEST(FlatGround, StartsAfterTwoLevelSecondsAndEndsAtOnceOnARamp) {
  FlatGroundAssumption ground(FlatGround::automatic);
  for (int i = 0; i < 20; ++i) {
    ground.observe(at(i), up_at_pitch_deg(0.5));
    EXPECT_FALSE(ground.holds()) << i;
  }
  ground.observe(at(20), up_at_pitch_deg(0.5));
  EXPECT_TRUE(ground.holds());
  ground.observe(at(21), up_at_pitch_deg(4.0));
  EXPECT_FALSE(ground.holds());
  ground.observe(at(22), up_at_pitch_deg(0.0));
  EXPECT_FALSE(ground.holds()) << "one level sweep is no floor";
}

TEST(FlatGround, NeedsGravity) {
  FlatGroundAssumption ground(FlatGround::automatic);
  for (int i = 0; i < 30; ++i)
    ground.observe(at(i), kLevel);
  EXPECT_TRUE(ground.holds());
  ground.observe(at(30), std::nullopt);
  EXPECT_FALSE(ground.holds());
}

TEST(FlatGround, SetByContextIgnoresGravity) {
  FlatGroundAssumption on(FlatGround::on), off(FlatGround::off);
  for (int i = 0; i < 30; ++i) {
    on.observe(at(i), up_at_pitch_deg(10));
    off.observe(at(i), kLevel);
  }
  EXPECT_TRUE(on.holds());
  EXPECT_FALSE(off.holds());
}

const Pose kLast{Eigen::Quaterniond::Identity(), {0, 0, 0.2}};
const Pose kRolledUpward{from_rpy_rad({0.02, -0.03, 0.5}), {1.0, 0.3, 0.25}};

TEST(FlatGround, SetByContextRetainsOnlyHeadingAndPath) {
  const FlatGroundAssumption ground(FlatGround::on);
  const Pose flat = ground.flatten(kLast, kRolledUpward, 1e8 * Matrix6::Identity());
  EXPECT_LT((flat.translation - Eigen::Vector3d(1.0, 0.3, 0.2)).norm(), 1e-12);
  EXPECT_LT((to_rpy_rad(flat.rotation) - Eigen::Vector3d(0, 0, 0.5)).norm(), 1e-3);
}

TEST(FlatGround, DetectedYieldsToLidarWhereThatIsMoreCertain) {
  FlatGroundAssumption ground(FlatGround::automatic);
  for (int i = 0; i < 30; ++i)
    ground.observe(at(i), kLevel);
  const Pose blind = ground.flatten(kLast, kRolledUpward, Matrix6::Zero());
  EXPECT_LT((blind.translation - Eigen::Vector3d(1.0, 0.3, 0.2)).norm(), 1e-12);
  EXPECT_LT((to_rpy_rad(blind.rotation) - Eigen::Vector3d(0, 0, 0.5)).norm(), 1e-3);

  const Matrix6 information = along_each_axis(0.001, 0.03).cwiseAbs2().cwiseInverse().asDiagonal();
  const Pose seen = ground.flatten(kLast, kRolledUpward, information);
  EXPECT_LT((seen.translation - kRolledUpward.translation).norm(), 0.003);
  EXPECT_LT(angle_rad(seen.rotation * kRolledUpward.rotation.conjugate()), 5e-4);
}

/// A standard deviation of lidar as large as that of the ground (5 mm, 15 mrad) halves the correction.
TEST(FlatGround, EachAxisYieldsToItsOwnInformation) {
  FlatGroundAssumption ground(FlatGround::automatic);
  for (int i = 0; i < 30; ++i)
    ground.observe(at(i), kLevel);
  const Pose risen{from_rpy_rad({0.02, 0.0, 0.0}), {1.0, 0.3, 0.25}};
  Matrix6 information = Matrix6::Zero();
  information(2, 2) = 1.0 / (0.005 * 0.005);
  const Pose lower = ground.flatten(kLast, risen, information);
  EXPECT_NEAR(lower.translation.z(), 0.225, 1e-12);
  EXPECT_NEAR(to_rpy_rad(lower.rotation).x(), 0.0, 1e-12);
  information(2, 2) = 0.0;
  information(3, 3) = 1.0 / (0.015 * 0.015);
  const Pose righted = ground.flatten(kLast, risen, information);
  EXPECT_NEAR(righted.translation.z(), 0.2, 1e-12);
  EXPECT_NEAR(to_rpy_rad(righted.rotation).x(), 0.01, 1e-6);
}

} // namespace
} // namespace locus
