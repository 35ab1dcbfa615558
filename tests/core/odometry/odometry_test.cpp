// SPDX-License-Identifier: Apache-2.0
#include "core/odometry/odometry.hpp"

#include <gtest/gtest-spi.h>
#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>

#include <algorithm>
#include <cstdio>
#include <functional>
#include <numbers>
#include <random>
#include <span>
#include <string>
#include <vector>

#include "core/robot.hpp"
#include "support/scenes.hpp"

namespace locus::test {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

/// Wheels with 0.5 % slip and a yaw drift, and a gyro with noise.
RobotSetup robot_with_wheels_and_imu() {
  RobotSetup setup;
  setup.lidars.front().range_noise_m = 0.02;
  setup.wheels = sim::OdometryFaults{.scale_error = 0.005, .yaw_drift_rad_per_m = 0.002};
  setup.imu = sim::ImuFaults{.gyro_noise_radps = 0.002, .accelerometer_noise_mps2 = 0.02};
  return setup;
}

RobotSetup robot_with_lidar_alone() {
  RobotSetup setup;
  setup.lidars.front().range_noise_m = 0.02;
  return setup;
}

/// Wheels that slip in bursts, as on a wet floor, by up to twice the true speed; nothing else but lidar.
RobotSetup robot_with_slipping_wheels() {
  RobotSetup setup = robot_with_lidar_alone();
  setup.wheels = sim::OdometryFaults{.scale_error = 0.005, .slip_bursts_per_min = 20.0};
  return setup;
}

/// 30 m along x, a half turn at 2 rad/s, and back.
sim::Trajectory sixty_metres(const sim::Start& start) {
  sim::Course course;
  for (int way = 0; way < 2; ++way)
    course.stand(seconds{1})
        .change_speed(2.0, seconds{2})
        .straight(26)
        .change_speed(0.0, seconds{2})
        .turn(std::numbers::pi, 2.0);
  return sim::Trajectory(course, start);
}

struct Outcome {
  std::vector<OdometryEstimate> estimates;
  double worst_error_m = 0.0; ///< against the truth, from the first estimate on
  double worst_error_deg = 0.0;
  std::size_t failed = 0;
};

Outcome drive_through(const sim::Scene& scene, const sim::Trajectory& trajectory, const RobotSetup& setup,
                      Duration duration) {
  Odometry odometry(setup.odometry(), setup.motion_sources());
  Outcome result;
  drive(scene, trajectory, setup, duration, [&](const Sweep& sweep) {
    const OdometryEstimate& estimate = result.estimates.emplace_back(odometry.process(sweep));
    const Pose truth = true_motion(trajectory, result.estimates.front().stamp, estimate.stamp);
    const Pose error = truth.inverse() * (result.estimates.front().T_odom_base.inverse() * estimate.T_odom_base);
    result.worst_error_m = std::max(result.worst_error_m, error.translation.norm());
    result.worst_error_deg = std::max(result.worst_error_deg, angle_rad(error.rotation) / kRadPerDeg);
    result.failed += estimate.failed ? 1 : 0;
  });
  testing::Test::RecordProperty("worst_error_mm", std::to_string(1e3 * result.worst_error_m));
  std::printf("%zu sweeps, %zu failed, worst error %.1f mm %.2f deg\n", result.estimates.size(), result.failed,
              1e3 * result.worst_error_m, result.worst_error_deg);
  return result;
}

bool is_covariance(const Matrix6& m) {
  return m.allFinite() && (m - m.transpose()).cwiseAbs().maxCoeff() < 1e-9 * m.cwiseAbs().maxCoeff() &&
         Eigen::SelfAdjointEigenSolver<Matrix6>(m).eigenvalues()[0] > 0.0;
}

void expect_sound(const std::vector<OdometryEstimate>& estimates) {
  for (std::size_t i = 0; i < estimates.size(); ++i) {
    const OdometryEstimate& e = estimates[i];
    ASSERT_TRUE(e.T_odom_base.finite());
    ASSERT_NEAR(e.T_odom_base.rotation.norm(), 1.0, 1e-9);
    ASSERT_TRUE(e.twist_base.allFinite());
    ASSERT_TRUE(e.pose_covariance.allFinite());
    ASSERT_TRUE(e.twist_covariance.allFinite());
    if (i == 0)
      continue;
    ASSERT_GT(e.stamp, estimates[i - 1].stamp);
    ASSERT_TRUE(is_covariance(e.pose_covariance)) << "estimate " << i;
    ASSERT_TRUE(is_covariance(e.twist_covariance)) << "estimate " << i;
  }
}

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

// --- Missing data -----------------------------------------------------------------------------------------------

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
  EXPECT_LT(sigma_m(late, 1), 0.1);
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
  EXPECT_NONFATAL_FAILURE(EXPECT_LT(beyond_m, 0.1), "beyond_m");     // known not to hold: decision 29
  EXPECT_NONFATAL_FAILURE(EXPECT_LT(creeps_mps, 0.1), "creeps_mps"); // known not to hold: decision 47
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
