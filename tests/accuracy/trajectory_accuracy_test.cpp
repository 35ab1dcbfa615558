// SPDX-License-Identifier: Apache-2.0
#include "accuracy/trajectory_accuracy.hpp"

#include <array>
#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

namespace locus {
namespace {

using std::chrono::milliseconds;
using Trajectory = std::vector<StampedPose>;

Pose yawed(double yaw_rad, const Eigen::Vector3d& position) { return {from_rpy_rad({0, 0, yaw_rad}), position}; }

/// One pose `pose_at(i)` per `interval`.
template <class PoseAt> Trajectory drive(int poses, Duration interval, PoseAt&& pose_at) {
  Trajectory trajectory;
  for (int i = 0; i < poses; ++i)
    trajectory.push_back({stamp_from_ns(1'000'000'000'000) + i * interval, pose_at(i)});
  return trajectory;
}

/// Straight ahead at 1 m/s.
Trajectory straight(int poses, double scale = 1.0) {
  return drive(poses, milliseconds{1000}, [&](int i) { return yawed(0, {scale * i, 0, 0}); });
}

/// A circle of 20 m, with hills.
Trajectory loop(int poses) {
  return drive(poses, milliseconds{100}, [](int i) {
    const double angle = 0.005 * i;
    return yawed(angle + 0.5 * std::numbers::pi, {20 * std::cos(angle), 20 * std::sin(angle), std::sin(7 * angle)});
  });
}

TEST(ErrorStatistics, AreThoseOfTheSet) {
  const ErrorStatistics statistics = statistics_of(std::array{3.0, 4.0});
  EXPECT_DOUBLE_EQ(statistics.max, 4.0);
  EXPECT_DOUBLE_EQ(statistics.mean, 3.5);
  EXPECT_DOUBLE_EQ(statistics.std, 0.5);
  EXPECT_DOUBLE_EQ(statistics.rmse, std::sqrt(12.5));
}

TEST(TrajectoryAccuracy, FrameOffsetIsNoError) {
  const Pose T_truth_odom{from_rpy_rad({0.3, -0.2, 2.5}), {300, -40, 7}};
  const Trajectory truth = loop(1000);
  Trajectory estimates = truth;
  for (StampedPose& estimate : estimates)
    estimate.T_source_base = T_truth_odom.inverse() * estimate.T_source_base;
  const auto accuracy = trajectory_accuracy(estimates, truth);
  ASSERT_TRUE(accuracy);
  EXPECT_EQ(accuracy->stamps.size(), 1000U);
  EXPECT_NEAR(accuracy->ape_m.max, 0, 1e-9);
  EXPECT_NEAR(*accuracy->rpe_10m_percent, 0, 1e-9);
  EXPECT_NEAR(*accuracy->rpe_10m_deg, 0, 1e-6);
  EXPECT_NEAR(accuracy->end_drift_m, 0, 1e-9);
  EXPECT_LT((accuracy->T_truth_odom.translation - T_truth_odom.translation).norm(), 1e-9);
  EXPECT_LT(accuracy->T_truth_odom.rotation.angularDistance(T_truth_odom.rotation), 1e-9);
}

TEST(TrajectoryAccuracy, PositionsAreComparedAfterAlignment) {
  // Lateral errors of 0.1 m that no rotation or translation of the line reduces.
  constexpr std::array kX_m{-3.0, -1.0, 1.0, 3.0}, kAside_m{0.1, -0.1, -0.1, 0.1};
  const auto at = [&](int i) { return static_cast<std::size_t>(i); };
  const Trajectory truth = drive(4, milliseconds{100}, [&](int i) { return yawed(0, {kX_m[at(i)], 0, 0}); });
  const Trajectory estimates = drive(4, milliseconds{100}, [&](int i) {
    return yawed(0, {kX_m[at(i)], 5 + kAside_m[at(i)], 0});
  });
  const auto accuracy = trajectory_accuracy(estimates, truth);
  ASSERT_TRUE(accuracy);
  for (const double error_m : accuracy->position_error_m)
    EXPECT_NEAR(error_m, 0.1, 1e-12);
  EXPECT_NEAR(accuracy->ape_m.rmse, 0.1, 1e-12);
  EXPECT_NEAR(accuracy->ape_m.std, 0, 1e-12);
}

TEST(TrajectoryAccuracy, WrongScaleIsNotAlignedAway) {
  const auto accuracy = trajectory_accuracy(straight(101, 1.01), straight(101));
  ASSERT_TRUE(accuracy);
  EXPECT_NEAR(accuracy->ape_m.max, 0.5, 1e-9) << "a metre too long, and centred";
  EXPECT_NEAR(*accuracy->rpe_10m_percent, 1.0, 1e-9);
  EXPECT_NEAR(accuracy->end_drift_m, 1.0, 1e-9);
}

TEST(TrajectoryAccuracy, YawScaleErrorAppearsPerTenMetres) {
  const Trajectory estimates = drive(31, milliseconds{1000}, [](int i) {
    return yawed(0.1 * kRadPerDeg * i, {1.0 * i, 0, 0});
  });
  const auto accuracy = trajectory_accuracy(estimates, straight(31));
  ASSERT_TRUE(accuracy);
  EXPECT_NEAR(*accuracy->rpe_10m_deg, 1.0, 1e-6);
}

TEST(WayDrift, IsTheMeanOverHundredsOfMetres) {
  const auto drift = way_drift(straight(301, 1.01), straight(301));
  ASSERT_TRUE(drift);
  EXPECT_NEAR(drift->way_m, 300, 1e-9);
  EXPECT_NEAR(*drift->percent, 1.0, 1e-9) << "over 100, 200 and 300 m";
  EXPECT_NEAR(*drift->deg_per_100m, 0, 1e-6);
  const Trajectory turning = drive(151, milliseconds{1000}, [](int i) {
    return yawed(0.01 * kRadPerDeg * i, {1.0 * i, 0, 0});
  });
  EXPECT_NEAR(*way_drift(turning, straight(151))->deg_per_100m, 1.0, 1e-6);
}

TEST(WayDrift, IsAbsentForAShortPath) {
  EXPECT_FALSE(way_drift(straight(100), straight(100))->percent) << "99 m";
  EXPECT_TRUE(way_drift(straight(101), straight(101))->percent);
  EXPECT_FALSE(way_drift(straight(10), {}));
}

/// Agrees with KITTI's own tool: ten of the hundred sections of 100 m, which start at every estimate, count.
TEST(WayDrift, StartsASegmentAtEveryTenthEstimate) {
  Trajectory estimates = straight(200);
  for (std::size_t i = 0; i < estimates.size(); ++i)
    estimates[i].T_source_base.translation.y() = i % 10 == 0 ? 0 : 1; // the ends of counted sections are correct, too
  EXPECT_NEAR(*way_drift(estimates, straight(200))->percent, 0, 1e-9);
}

TEST(TrajectoryAccuracy, EndDriftCountsTheFirstHeading) {
  Trajectory estimates = straight(101);
  estimates.front().T_source_base.rotation = from_rpy_rad({0, 0, 1 * kRadPerDeg});
  const auto accuracy = trajectory_accuracy(estimates, straight(101));
  ASSERT_TRUE(accuracy);
  EXPECT_NEAR(accuracy->end_drift_m, 100 * 2 * std::sin(0.5 * kRadPerDeg), 1e-9);
  EXPECT_NEAR(accuracy->ape_m.max, 0, 1e-9);
}

TEST(TrajectoryAccuracy, TruthIsInterpolatedAtTheStampOfTheEstimate) {
  const Trajectory truth = drive(2, milliseconds{1000}, [](int i) {
    return yawed(90 * kRadPerDeg * i, {2.0 * i, 4.0 * i, 0});
  });
  const Trajectory estimates{{truth.front().stamp + milliseconds{250}, Pose{}}};
  const auto accuracy = trajectory_accuracy(estimates, truth);
  ASSERT_TRUE(accuracy);
  EXPECT_LT((accuracy->T_truth_odom.translation - Eigen::Vector3d(0.5, 1, 0)).norm(), 1e-9);
  EXPECT_LT(accuracy->T_truth_odom.rotation.angularDistance(from_rpy_rad({0, 0, 22.5 * kRadPerDeg})), 1e-9);
}

TEST(TrajectoryAccuracy, FewPosesGivePartialFigures) {
  const auto one = trajectory_accuracy(straight(1), straight(1));
  ASSERT_TRUE(one);
  EXPECT_EQ(one->ape_m.max, 0);
  EXPECT_EQ(one->end_drift_m, 0);
  EXPECT_FALSE(one->rpe_10m_percent) << "no stretch of 10 m";
  EXPECT_FALSE(trajectory_accuracy(straight(10), straight(10))->rpe_10m_percent) << "9 m";
  EXPECT_TRUE(trajectory_accuracy(straight(11), straight(11))->rpe_10m_percent) << "10 m";
}

TEST(TrajectoryAccuracy, OnlyTheSpanOfTheTruthIsCompared) {
  const Trajectory truth = straight(5);
  Trajectory estimates = straight(5);
  for (StampedPose& estimate : estimates)
    estimate.stamp += milliseconds{1500};
  const auto accuracy = trajectory_accuracy(estimates, truth);
  ASSERT_TRUE(accuracy);
  EXPECT_EQ(accuracy->stamps, (std::vector<Stamp>{estimates[0].stamp, estimates[1].stamp, estimates[2].stamp}));
}

TEST(TrajectoryAccuracy, IsAbsentWithoutCommonTime) {
  Trajectory later = straight(5);
  for (StampedPose& pose : later)
    pose.stamp += std::chrono::hours{1};
  EXPECT_FALSE(trajectory_accuracy(straight(5), later));
  EXPECT_FALSE(trajectory_accuracy(later, straight(5)));
  EXPECT_FALSE(trajectory_accuracy({}, straight(5)));
  EXPECT_FALSE(trajectory_accuracy(straight(5), {}));
}

TEST(TrajectoryAccuracy, GapOfTheTruthIsNotCompared) {
  const Trajectory estimates = drive(100, milliseconds{100}, [](int i) {
    return yawed(0, {0.1 * i, i > 20 && i < 60 ? 3.0 : 0.0, 0}); // around an obstacle that the truth does not contain
  });
  Trajectory truth = drive(100, milliseconds{100}, [](int i) { return yawed(0, {0.1 * i, 0, 0}); });
  truth.erase(truth.begin() + 21, truth.begin() + 60);
  const auto accuracy = trajectory_accuracy(estimates, truth);
  ASSERT_TRUE(accuracy);
  EXPECT_EQ(accuracy->stamps.size(), 61U);
  EXPECT_NEAR(accuracy->ape_m.max, 0, 1e-9);
}

TEST(TrajectoryAccuracy, SparseTruthIsNoGap) {
  const Trajectory truth = drive(11, milliseconds{5000}, [](int i) { return yawed(0, {5.0 * i, 0, 0}); });
  const auto accuracy = trajectory_accuracy(straight(51), truth);
  ASSERT_TRUE(accuracy);
  EXPECT_EQ(accuracy->stamps.size(), 51U);
  EXPECT_NEAR(accuracy->ape_m.max, 0, 1e-9);
}

TEST(TrajectoryAccuracy, AtRestFramesAreAlignedByAttitude) {
  const Pose T_truth_base{from_rpy_rad({0.1, 0.2, 3}), {1, 2, 3}};
  const auto standing = [](const Pose& pose) { return drive(20, milliseconds{100}, [&](int) { return pose; }); };
  const auto accuracy = trajectory_accuracy(standing(Pose{}), standing(T_truth_base));
  ASSERT_TRUE(accuracy);
  EXPECT_LT(accuracy->T_truth_odom.rotation.angularDistance(T_truth_base.rotation), 1e-9);
  EXPECT_LT((accuracy->T_truth_odom.translation - T_truth_base.translation).norm(), 1e-9);
}

} // namespace
} // namespace locus
