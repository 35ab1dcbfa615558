// SPDX-License-Identifier: Apache-2.0
// The odometry without lidar, without sources, or without a motion that lidar observes.
#include "core/odometry/odometry.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <utility>
#include <vector>

#include "core/odometry/odometry_drive.hpp"
#include "core/robot.hpp"
#include "support/scenes.hpp"

namespace locus::test {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

/// Wheels that slip in bursts, as on a wet floor, by up to twice the true speed; nothing else but lidar.
RobotSetup robot_with_slipping_wheels() {
  RobotSetup setup = robot_with_lidar_alone();
  setup.wheels = sim::OdometryFaults{.scale_error = 0.005, .slip_bursts_per_min = 20.0};
  return setup;
}

TEST(Odometry, TenSecondsWithoutLidarAreBridgedByWheelOdometry) {
  const sim::Trajectory trajectory = sixty_metres({.position_m = {5, 0}});
  const Stamp dark = trajectory.start() + seconds{5}, light = dark + seconds{10};
  RobotSetup setup = robot_with_wheels_and_imu();
  setup.is_lost = [=](std::size_t, Stamp stamp) { return stamp >= dark && stamp < light; };
  const Outcome result = drive_through(sim::corridor(40), trajectory, setup, seconds{25});
  std::size_t dead_reckoning = 0;
  for (const OdometryEstimate& e : result.estimates) {
    const bool in_the_dark = e.stamp > dark + milliseconds{100} && e.stamp < light - milliseconds{10};
    dead_reckoning += e.state == TrackingState::dead_reckoning ? 1 : 0;
    if (in_the_dark) {
      EXPECT_EQ(e.state, TrackingState::dead_reckoning);
      EXPECT_EQ(e.prior.translation, SourceId{0});
      EXPECT_FALSE(e.keyframe);
    }
  }
  EXPECT_NEAR(static_cast<double>(dead_reckoning), 100.0, 3.0);
  EXPECT_LT(result.worst_error_m, 0.005 * 22 + 0.05) << "half a percent of slip";
  expect_sound(result.estimates);
}

TEST(Odometry, WheelsThatSlipDoNotDragTheEstimateAlong) {
  const sim::Trajectory trajectory(sim::plant_course(seconds{60}, 1.0), sim::plant_start());
  const auto drive_with = [&](const RobotSetup& setup) {
    return drive_through(sim::plant(), trajectory, setup, seconds{60}).worst_error_m;
  };
  EXPECT_LT(drive_with(robot_with_slipping_wheels()), 1.2 * drive_with(robot_with_lidar_alone()));
}

TEST(Odometry, WheelsBridgeABareCorridorWithGrowingSigma) {
  const sim::Trajectory trajectory = sixty_metres({.position_m = {50, 0}});
  const Outcome result =
      drive_through(sim::corridor(200, sim::Walls::bare), trajectory, robot_with_wheels_and_imu(), seconds{15});
  const Pose truth = true_motion(trajectory, result.estimates.front().stamp, result.estimates.back().stamp);
  const double driven_m = truth.translation.norm();
  ASSERT_GT(driven_m, 20.0);
  EXPECT_LT(result.worst_error_m, 0.007 * driven_m) << "half a percent of slip";
  const auto sigma_m = [](const OdometryEstimate& e, int axis) { return std::sqrt(e.pose_covariance(axis, axis)); };
  const OdometryEstimate &early = result.estimates[5], &late = result.estimates.back();
  EXPECT_EQ(late.state, TrackingState::degenerate);
  EXPECT_LT(late.observability[0], 0.01);
  EXPECT_GT(late.observability[1], 0.1);
  EXPECT_GT(sigma_m(late, 0), 10 * sigma_m(early, 0));
  const double mounting_m = 0.005 * driven_m; // standard deviation of the lidar's mounting: it bends the path
  EXPECT_LT(std::sqrt(late.pose_covariance(1, 1) - mounting_m * mounting_m), 0.05) << "the walls are seen";
  EXPECT_LT(result.worst_error_m, 3 * sigma_m(late, 0));
}

TEST(Odometry, UnobservedMotionDecaysToRestWithHonestSigma) {
  const sim::Trajectory trajectory = sixty_metres({.position_m = {50, 0}});
  RobotSetup setup = robot_with_wheels_and_imu();
  const Stamp lost = trajectory.start() + seconds{7};
  setup.is_silent = [=](std::size_t, Stamp stamp) { return stamp >= lost; };
  const Outcome result = drive_through(sim::corridor(200, sim::Walls::bare), trajectory, setup, seconds{14});
  double beyond_m = 0.0, creeps_mps = 0.0;
  for (const OdometryEstimate& estimate : result.estimates) {
    const Pose truth = true_motion(trajectory, result.estimates.front().stamp, estimate.stamp);
    const double off_m = std::abs(estimate.T_odom_base.translation.x() - truth.translation.x());
    EXPECT_LT(std::abs(estimate.twist_base[0]), 2.2) << "the robot drives at 2 m/s";
    beyond_m = std::max(beyond_m, off_m - 4 * std::sqrt(estimate.pose_covariance(0, 0)));
    const bool long_lost = estimate.stamp > lost + seconds{4}; // 1 s at constant speed, then 3 s of decay
    creeps_mps = std::max(creeps_mps, long_lost ? std::abs(estimate.twist_base[0]) : 0.0);
    EXPECT_TRUE(!long_lost || estimate.state == TrackingState::degenerate ||
                estimate.state == TrackingState::dead_reckoning);
  }
  EXPECT_LT(beyond_m, 0.1);
  EXPECT_LT(creeps_mps, 0.1);
}

TEST(Odometry, BlindStandstillIsHeld) {
  const sim::Trajectory trajectory(sim::Course{}
                                       .stand(seconds{1})
                                       .change_speed(1.0, seconds{1})
                                       .straight(3)
                                       .change_speed(0.0, seconds{1})
                                       .stand(seconds{20}),
                                   {.position_m = {50, 0}});
  const sim::Scene street = sim::street(200);
  for (int into_the_turn_ms = 5; into_the_turn_ms < 30; into_the_turn_ms += 5) {
    RobotSetup setup;
    setup.lidars[0].range_noise_m = 0.03;
    const Stamp dark = trajectory.start() + milliseconds{6600 + into_the_turn_ms};
    setup.is_lost = [=](std::size_t, Stamp stamp) { return stamp >= dark; };
    Odometry odometry(setup.odometry(), setup.motion_sources());
    Pose last_seen;
    OdometryEstimate last;
    for (const Sweep& sweep : sweeps_of(street, trajectory, setup, seconds{15})) {
      last = odometry.process(sweep);
      if (sweep.end < dark)
        last_seen = last.T_odom_base;
    }
    ASSERT_EQ(last.state, TrackingState::dead_reckoning);
    EXPECT_LT((last.T_odom_base.translation - last_seen.translation).norm(), 0.06) << into_the_turn_ms;
  }
}

TEST(Odometry, BlindMotionDecaysToRest) {
  const sim::Trajectory trajectory = sixty_metres({.position_m = {50, 0}});
  RobotSetup setup;
  const Stamp dark = trajectory.start() + seconds{10};
  setup.is_lost = [=](std::size_t, Stamp stamp) { return stamp >= dark; };
  Odometry odometry(setup.odometry(), setup.motion_sources());
  double gone_m = 0, after_a_second_m = 0;
  for (const Sweep& sweep : sweeps_of(sim::street(200), trajectory, setup, seconds{25})) {
    const OdometryEstimate estimate = odometry.process(sweep);
    EXPECT_TRUE(sweep.end < dark + milliseconds{900} || estimate.failed);
    if (sweep.end < dark)
      gone_m = estimate.T_odom_base.translation.norm();
    if (sweep.end < dark + seconds{1})
      after_a_second_m = estimate.T_odom_base.translation.norm();
    EXPECT_TRUE(sweep.end < dark || estimate.T_odom_base.translation.norm() < gone_m + 4.5) << "two seconds at 2 m/s";
    EXPECT_TRUE(sweep.end < dark + seconds{10} || estimate.twist_base.norm() < 0.001) << estimate.twist_base;
  }
  EXPECT_NEAR(after_a_second_m, gone_m + 2.0, 0.3);
}

TEST(Odometry, ErrorOfABlindStretchIsCorrectedByTheMap) {
  const sim::Trajectory trajectory(sim::room_course(seconds{40}, 1.0), sim::room_start());
  const Stamp dark = trajectory.start() + seconds{15}, light = dark + seconds{10};
  RobotSetup setup = robot_with_wheels_and_imu();
  setup.is_lost = [=](std::size_t, Stamp stamp) { return stamp >= dark && stamp < light; };
  const Outcome result = drive_through(sim::room(), trajectory, setup, seconds{30});
  const OdometryEstimate& last = result.estimates.back();
  const Pose truth = true_motion(trajectory, result.estimates.front().stamp, last.stamp);
  EXPECT_LT(
      (truth.translation - (result.estimates.front().T_odom_base.inverse() * last.T_odom_base).translation).norm(),
      0.03);
}

/// A robot that has driven a short distance into a room.
class OdometryUnderWay : public testing::Test {
 protected:
  OdometryUnderWay() {
    sweeps_ = sweeps_of(sim::room(), trajectory_, setup_, seconds{5});
    for (std::size_t i = 0; i + 1 < sweeps_.size(); ++i)
      last_ = odometry_.process(sweeps_[i]);
  }

  /// Returns the next sweep, with these points.
  Sweep next_with(std::vector<SweepPoint> points) {
    Sweep sweep = sweeps_.back();
    sweep.registered = points.size();
    sweep.points = std::move(points);
    return sweep;
  }

  static std::vector<SweepPoint> nonsense(std::size_t count) {
    std::mt19937 random{1};
    std::uniform_real_distribution<float> anywhere{-60.0F, 60.0F};
    std::vector<SweepPoint> points;
    for (std::size_t i = 0; i < count; ++i)
      points.push_back({{anywhere(random), anywhere(random), anywhere(random)}, Eigen::Vector3f::Zero(), 0.05F, 0, 0});
    return points;
  }

  sim::Trajectory trajectory_{sim::room_course(seconds{10}, 1.0), sim::room_start()};
  RobotSetup setup_ = robot_with_wheels_and_imu();
  Odometry odometry_{setup_.odometry(), setup_.motion_sources()};
  std::vector<Sweep> sweeps_;
  OdometryEstimate last_;
};

TEST_F(OdometryUnderWay, FailureYieldsThePredictionAndLeavesTheMapUnchanged) {
  ASSERT_FALSE(last_.failed);
  const std::size_t fine = odometry_.map().fine().size(), coarse = odometry_.map().coarse().size();
  const OdometryEstimate estimate = odometry_.process(next_with(nonsense(2000)));
  EXPECT_TRUE(estimate.failed);
  EXPECT_EQ(estimate.state, TrackingState::dead_reckoning);
  EXPECT_FALSE(estimate.keyframe);
  EXPECT_EQ(odometry_.map().fine().size(), fine);
  EXPECT_EQ(odometry_.map().coarse().size(), coarse);
  const Pose moved = last_.T_odom_base.inverse() * estimate.T_odom_base;
  const Pose truth = true_motion(trajectory_, last_.stamp, estimate.stamp);
  EXPECT_LT((moved.translation - truth.translation).norm(), 0.01 * truth.translation.norm())
      << "the wheels are half a percent off, and the filter knows";
  EXPECT_TRUE(is_covariance(estimate.pose_covariance));
}

TEST_F(OdometryUnderWay, AnEmptySweepIsDeadReckoning) {
  const OdometryEstimate estimate = odometry_.process(next_with({}));
  EXPECT_TRUE(estimate.failed);
  EXPECT_EQ(estimate.points, 0U);
  EXPECT_EQ(estimate.state, TrackingState::dead_reckoning);
  EXPECT_TRUE(estimate.T_odom_base.finite());
  EXPECT_TRUE(is_covariance(estimate.pose_covariance));
}

TEST_F(OdometryUnderWay, ThreePointsAreDeadReckoning) {
  std::vector<SweepPoint> three(sweeps_.back().points.begin(), sweeps_.back().points.begin() + 3);
  const OdometryEstimate estimate = odometry_.process(next_with(std::move(three)));
  EXPECT_EQ(estimate.state, TrackingState::dead_reckoning);
  EXPECT_TRUE(estimate.T_odom_base.finite());
  EXPECT_FALSE(estimate.keyframe);
}

TEST_F(OdometryUnderWay, CovarianceGrowsWithoutLidar) {
  double before_m2 = last_.pose_covariance.topLeftCorner<3, 3>().trace();
  Sweep sweep = next_with({});
  for (int i = 0; i < 20; ++i) {
    const double now_m2 = odometry_.process(sweep).pose_covariance.topLeftCorner<3, 3>().trace();
    EXPECT_GT(now_m2, before_m2);
    before_m2 = now_m2;
    sweep.start = sweep.end;
    sweep.end += milliseconds{100};
  }
}

TEST_F(OdometryUnderWay, ImmediateStopStillGivesAnEstimate) {
  const OdometryEstimate estimate = odometry_.process(sweeps_.back(), [] { return true; });
  EXPECT_TRUE(estimate.T_odom_base.finite());
  EXPECT_LE(estimate.scan_to_submap.iterations, 1);
  EXPECT_TRUE(is_covariance(estimate.pose_covariance));
}

TEST(Odometry, EmptySweepsAtTheStartAreSkipped) {
  Odometry odometry(OdometryOptions{});
  Sweep empty;
  empty.start = stamp_from_ns(1'000'000'000);
  empty.end = empty.start + milliseconds{100};
  for (int i = 0; i < 3; ++i) {
    const OdometryEstimate estimate = odometry.process(empty);
    EXPECT_TRUE(estimate.failed);
    EXPECT_EQ(estimate.T_odom_base, Pose{});
    empty.start = empty.end;
    empty.end += milliseconds{100};
  }
  EXPECT_EQ(odometry.map().fine().size(), 0U);
  const sim::Trajectory trajectory(sim::Course{}.stand(seconds{1}));
  for (const Sweep& sweep : sweeps_of(sim::room(), trajectory, RobotSetup{}, milliseconds{550}))
    EXPECT_FALSE(odometry.process(sweep).failed);
  EXPECT_GT(odometry.map().fine().size(), 0U);
}

} // namespace
} // namespace locus::test
