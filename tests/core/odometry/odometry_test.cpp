// SPDX-License-Identifier: Apache-2.0
#include "core/odometry/odometry.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <span>
#include <vector>

#include "core/odometry/odometry_drive.hpp"
#include "core/robot.hpp"
#include "support/scenes.hpp"

namespace locus::test {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

// --- Accuracy ---------------------------------------------------------------------------------------------------

TEST(Odometry, StaysWithinThreeCentimetresOverSixtyMetresInARoom) {
  constexpr Duration kLaps = seconds{64};
  const sim::Trajectory trajectory(sim::room_course(kLaps, 1.0), sim::room_start());
  const Outcome result = drive_through(sim::room(), trajectory, robot_with_wheels_and_imu(), kLaps);
  EXPECT_EQ(result.failed, 0U);
  EXPECT_LT(result.worst_error_m, 0.03);
  expect_sound(result.estimates);
}

TEST(Odometry, StaysWithinThreeCentimetresOverSixtyMetresInACorridor) {
  const sim::Trajectory trajectory = sixty_metres({.position_m = {5, 0}});
  const Outcome result =
      drive_through(sim::corridor(40), trajectory, robot_with_wheels_and_imu(), trajectory.end() - trajectory.start());
  EXPECT_EQ(result.failed, 0U);
  EXPECT_LT(result.worst_error_m, 0.03);
  expect_sound(result.estimates);
}

TEST(Odometry, StaysWithinThreeCentimetresOverSixtyMetresInATunnel) {
  const sim::Trajectory trajectory = sixty_metres({.position_m = {5, 0}});
  const Outcome result =
      drive_through(sim::tunnel(40), trajectory, robot_with_wheels_and_imu(), trajectory.end() - trajectory.start());
  EXPECT_EQ(result.failed, 0U);
  EXPECT_LT(result.worst_error_m, 0.03);
  expect_sound(result.estimates);
}

TEST(Odometry, NeedsNoSourceInARoom) {
  constexpr Duration kLaps = seconds{30};
  const sim::Trajectory trajectory(sim::room_course(kLaps, 1.0), sim::room_start());
  const Outcome result = drive_through(sim::room(), trajectory, robot_with_lidar_alone(), kLaps);
  EXPECT_LT(result.worst_error_m, 0.10);
  EXPECT_FALSE(result.estimates.back().prior.rotation);
  EXPECT_EQ(result.estimates.back().prior.otherwise, NoSourcePrior::constant_velocity);
  expect_sound(result.estimates);
}

TEST(Odometry, NeedsNoSourceInAStreetAtFifteenMetresPerSecond) {
  const sim::Trajectory trajectory(sim::Course{}.change_speed(15.0, Duration::zero()).straight(300));
  const Outcome result = drive_through(sim::street(300), trajectory, robot_with_lidar_alone(), seconds{15});
  EXPECT_EQ(result.failed, 0U);
  EXPECT_LT(result.worst_error_m, 0.002 * 225) << "most of it is the heading of the first sweep";
  expect_sound(result.estimates);
}

// --- As in the paper --------------------------------------------------------------------------------------------

TEST(Odometry, ScanToScanRunsForEverySweepOrAtTheStartOnly) {
  const sim::Trajectory trajectory(sim::room_course(seconds{10}, 1.0), sim::room_start());
  const std::vector<Sweep> sweeps = sweeps_of(sim::room(), trajectory, robot_with_lidar_alone(), seconds{6});
  for (const ScanToScanMode mode : {ScanToScanMode::always, ScanToScanMode::automatic, ScanToScanMode::off}) {
    OdometryOptions options;
    options.scan_to_scan_mode = mode;
    Odometry odometry(options);
    OdometryEstimate last;
    std::size_t matched = 0, moving = 0;
    for (const Sweep& sweep : sweeps) {
      const Pose T_odom_last = last.T_odom_base;
      last = odometry.process(sweep);
      odometry.prepare_next();
      moving += last.state != TrackingState::standstill ? 1 : 0;
      if (last.scan_to_scan.iterations == 0)
        continue;
      ++matched;
      const Pose difference = last.scan_to_scan.T_target_source.inverse() * (T_odom_last.inverse() * last.T_odom_base);
      EXPECT_LT(difference.translation.norm(), 0.05) << "what it finds is the motion since the last sweep";
    }
    if (mode == ScanToScanMode::always) {
      EXPECT_GE(matched + 2, moving) << "all but the first two";
      EXPECT_GT(matched, 30U);
    } else {
      EXPECT_EQ(matched, 0U);
    }
    const Pose truth = true_motion(trajectory, sweeps.front().end, sweeps.back().end);
    EXPECT_LT((last.T_odom_base.translation - truth.translation).norm(), 0.10);
  }
}

TEST(Odometry, WithoutSourcesZeroMotionMayBeThePrior) {
  const sim::Trajectory trajectory(sim::room_course(seconds{10}, 1.0), sim::room_start());
  OdometryOptions options;
  options.scan_to_scan_mode = ScanToScanMode::always;
  options.no_source_prior = NoSourcePrior::identity;
  Odometry odometry(options);
  OdometryEstimate last;
  const std::vector<Sweep> sweeps = sweeps_of(sim::room(), trajectory, robot_with_lidar_alone(), seconds{6});
  for (const Sweep& sweep : sweeps)
    last = odometry.process(sweep);
  EXPECT_EQ(last.prior.otherwise, NoSourcePrior::identity);
  const Pose truth = true_motion(trajectory, sweeps.front().end, sweeps.back().end);
  EXPECT_LT((last.T_odom_base.translation - truth.translation).norm(), 0.10);
}

// --- Same input, same bits --------------------------------------------------------------------------------------

TEST(Odometry, SameBitsForAnyNumberOfThreadsAndOnEveryRun) {
  const sim::Scene scene = sim::room();
  const sim::Trajectory trajectory(sim::room_course(seconds{10}, 1.0), sim::room_start());
  for (const RobotSetup& setup : {robot_with_wheels_and_imu(), robot_with_lidar_alone()}) {
    const std::vector<Sweep> sweeps = sweeps_of(scene, trajectory, setup, seconds{6});
    const auto poses = [&](int threads, bool prepares = false) {
      OdometryOptions options = setup.odometry();
      options.threads = threads;
      Odometry odometry(options, setup.motion_sources());
      std::vector<Pose> result;
      for (const Sweep& sweep : sweeps) {
        result.push_back(odometry.process(sweep).T_odom_base);
        if (prepares)
          odometry.prepare_next();
      }
      return result;
    };
    const std::vector<Pose> expected = poses(1);
    std::vector<int> runs{2, 4};
    runs.insert(runs.end(), 10, 2);
    for (const int threads : runs)
      EXPECT_TRUE(poses(threads) == expected) << threads << " threads";
    EXPECT_TRUE(poses(1, true) == expected) << "what the next sweep needs done beforehand";
  }
}

// --- Map and initialisation -------------------------------------------------------------------------------------

TEST(Odometry, KeyframesFollowAMetreOrThirtyDegrees) {
  const sim::Trajectory trajectory(sim::room_course(seconds{20}, 1.0), sim::room_start());
  const Outcome result = drive_through(sim::room(), trajectory, robot_with_wheels_and_imu(), seconds{20});
  ASSERT_TRUE(result.estimates.front().keyframe);
  Pose T_odom_keyframe = result.estimates.front().T_odom_base;
  std::size_t keyframes = 0;
  for (std::size_t i = 1; i < result.estimates.size(); ++i) {
    const OdometryEstimate& e = result.estimates[i];
    const Pose moved = T_odom_keyframe.inverse() * e.T_odom_base;
    const bool far = moved.translation.norm() > 1.0 || angle_rad(moved.rotation) > 30 * kRadPerDeg;
    EXPECT_EQ(e.keyframe, far) << "estimate " << i;
    if (e.keyframe)
      T_odom_keyframe = e.T_odom_base;
    keyframes += e.keyframe ? 1 : 0;
  }
  EXPECT_GT(keyframes, 15U);
}

TEST(Odometry, StandstillIsHeldAndAddsNothingToTheMap) {
  const sim::Trajectory trajectory(sim::Course{}.stand(seconds{10}));
  const RobotSetup setup = robot_with_lidar_alone();
  Odometry odometry(setup.odometry(), setup.motion_sources());
  std::vector<std::size_t> sizes;
  std::vector<OdometryEstimate> estimates;
  drive(sim::room(), trajectory, setup, seconds{10}, [&](const Sweep& sweep) {
    estimates.push_back(odometry.process(sweep));
    sizes.push_back(odometry.map().fine().size());
  });
  ASSERT_GT(sizes.size(), 90U);
  EXPECT_EQ(sizes.back(), sizes[2]);
  for (const OdometryEstimate& e : std::span(estimates).subspan(20)) {
    ASSERT_EQ(e.state, TrackingState::standstill);
    ASSERT_EQ(e.T_odom_base, estimates.back().T_odom_base);
    ASSERT_TRUE(e.twist_base.isZero());
  }
  const Pose error = estimates.front().T_odom_base.inverse() * estimates.back().T_odom_base;
  EXPECT_LT(error.translation.norm(), 0.005);
  EXPECT_LT(angle_rad(error.rotation), 0.05 * kRadPerDeg);
}

TEST(Odometry, StartsLevelByGravityWithZeroYaw) {
  const sim::Trajectory trajectory(sim::Course{}.stand(seconds{1}));
  std::vector<Sweep> sweeps = sweeps_of(sim::room(), trajectory, RobotSetup{}, milliseconds{250});
  ASSERT_FALSE(sweeps.empty());
  const Eigen::Vector3d rpy_rad{5 * kRadPerDeg, -3 * kRadPerDeg, 0.0};
  const Eigen::Vector3d up = from_rpy_rad(rpy_rad).conjugate() * Eigen::Vector3d{0, 0, 9.80665};
  sweeps.front().motion.specific_force = SpecificForce{up, up};
  const OdometryEstimate estimate = Odometry(OdometryOptions{}).process(sweeps.front());
  EXPECT_EQ(estimate.T_odom_base.translation, Eigen::Vector3d::Zero());
  EXPECT_LT((to_rpy_rad(estimate.T_odom_base.rotation) - rpy_rad).norm(), 1e-9);
}

TEST(Odometry, AccelerationDoesNotTiltTheStart) {
  const sim::Trajectory trajectory(sim::Course{}.stand(seconds{1}));
  std::vector<Sweep> sweeps = sweeps_of(sim::room(), trajectory, RobotSetup{}, milliseconds{250});
  sweeps.front().motion.specific_force = SpecificForce{{6.0, 0, 9.80665}, {6.0, 0, 9.80665}};
  EXPECT_EQ(Odometry(OdometryOptions{}).process(sweeps.front()).T_odom_base, Pose{});
}

/// Regression: the standard deviation was 100 deg/s instead of 100 rad/s, so that a flick of a hand was two sigma.
TEST(Odometry, FourRadiansPerSecondAtTheStartAreWithinSigma) {
  const sim::Trajectory trajectory(sim::room_course(seconds{1}, 1.0), sim::room_start());
  const Outcome result = drive_through(sim::room(), trajectory, robot_with_lidar_alone(), seconds{1});
  EXPECT_GT(std::sqrt(result.estimates.front().twist_covariance(5, 5)), 8.0);
}

/// Returns the standard deviation of the wheels' scale after each sweep of ten seconds in a room.
std::vector<double> sigma_of_scale(const std::function<void(std::size_t sweep, SourcePose& wheels)>& change) {
  const sim::Trajectory trajectory(sim::room_course(seconds{10}, 1.0), sim::room_start());
  const RobotSetup setup = robot_with_wheels_and_imu();
  Odometry odometry(setup.odometry(), setup.motion_sources());
  std::vector<double> sigma;
  drive(sim::room(), trajectory, setup, seconds{10}, [&](Sweep sweep) {
    change(sigma.size(), sweep.motion.sources[0]);
    const OdometryEstimate estimate = odometry.process(sweep);
    sigma.push_back(estimate.sources[0].learned ? estimate.sources[0].learned->scale().sigma : 0.0);
  });
  return sigma;
}

/// Regression: a gap of 60 ms, from a hiccup or a busy processor, erased everything learned about the wheels.
TEST(Odometry, MissingSampleDoesNotResetTheSource) {
  const std::vector<double> sigma = sigma_of_scale([](std::size_t sweep, SourcePose& wheels) {
    if (sweep == 60)
      wheels = SourcePose{};
  });
  EXPECT_LT(sigma[59], 0.5 * sigma[2]);
  EXPECT_LT(sigma[61], 1.1 * sigma[59]);
}

TEST(Odometry, SourceThatReturnsIsReset) {
  const std::vector<double> sigma = sigma_of_scale([](std::size_t sweep, SourcePose& wheels) {
    if (sweep >= 60 && sweep < 70)
      wheels = SourcePose{};
    if (sweep >= 70)
      ++wheels.epoch;
  });
  EXPECT_GT(sigma[70], 2.0 * sigma[59]);
}

TEST(Odometry, QueuedSourcesAreUsedWhileHealthy) {
  const sim::Trajectory trajectory(sim::room_course(seconds{10}, 1.0), sim::room_start());
  RobotSetup setup = robot_with_wheels_and_imu();
  const Stamp silent = trajectory.start() + seconds{5};
  setup.is_silent = [=](std::size_t source, Stamp stamp) { return source == 0 && stamp > silent; };
  const Outcome result = drive_through(sim::room(), trajectory, setup, seconds{10});
  for (const OdometryEstimate& e : result.estimates) {
    if (e.stamp < silent && e.stamp > trajectory.start() + milliseconds{300}) {
      EXPECT_EQ(e.prior.translation, SourceId{0});
      EXPECT_EQ(e.prior.rotation, SourceId{1});
    } else if (e.stamp > silent + milliseconds{300}) {
      EXPECT_FALSE(e.prior.translation);
      EXPECT_EQ(e.prior.rotation, SourceId{1});
    }
  }
  EXPECT_LT(result.worst_error_m, 0.05);
}

} // namespace
} // namespace locus::test
