// SPDX-License-Identifier: Apache-2.0
#include "core/odometry/motion_filter.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <numbers>
#include <optional>
#include <random>
#include <tuple>

#include "core/odometry/gaussian_robot.hpp"

namespace locus::test {
namespace {

// --- Consistency ------------------------------------------------------------------------------------------------

/// Means over drives of 20 s. With white noise alone those of 2000 sweeps or more would be within a few percent of one;
/// the margin covers effects that the filter models and this robot does not have.
double mean_nees(double rate_hz, Sensing sensing) {
  sensing.lidar = usual_lidar(1.0 / rate_hz);
  double sum = 0.0;
  int count = 0;
  for (unsigned seed = 1; seed <= 10; ++seed) {
    GaussianRobot robot(winding, {}, seed);
    MotionFilter filter = begun_with(robot, winding);
    for (int i = 0; i < static_cast<int>(20 * rate_hz); ++i) {
      sweep(filter, robot, 1.0 / rate_hz, sensing);
      sum += nees(filter, robot);
      ++count;
    }
  }
  return sum / count;
}

void expect_consistent(const Sensing& sensing) {
  for (const double rate_hz : kRates_hz) {
    const double mean = mean_nees(rate_hz, sensing);
    EXPECT_GT(mean, 0.6) << rate_hz << " Hz";
    EXPECT_LT(mean, 1.5) << rate_hz << " Hz";
  }
}

TEST(MotionFilter, IsConsistentWithLidarAlone) { expect_consistent({.wheels = false, .gyro = false}); }
TEST(MotionFilter, IsConsistentWithGyro) { expect_consistent({.wheels = false}); }
TEST(MotionFilter, IsConsistentWithWheels) { expect_consistent({.gyro = false}); }
TEST(MotionFilter, IsConsistentWithWheelsAndGyro) { expect_consistent({}); }
TEST(MotionFilter, IsConsistentWithAccelerometerAndGyro) { expect_consistent({.wheels = false, .force = true}); }
TEST(MotionFilter, IsConsistentWithAllSensors) { expect_consistent({.force = true}); }

// --- Evidence -----------------------------------------------------------------------------------------------------

TEST(MotionFilter, SurpriseIsStudentsTPlusOccamsFactor) {
  GaussianRobot robot(winding, {}, 1);
  MotionFilter filter = begun_with(robot, winding);
  filter.predict(0.1, 0.1, std::nullopt, {});
  filter.move();
  Registration found;
  found.T_target_source = filter.pose();
  found.twist_base = filter.twist_base();
  EXPECT_NEAR(filter.surprise(found), 0.0, 1e-6);
  const Matrix12 P = filter.covariance();
  found.information = 3.0 * P.inverse();
  EXPECT_NEAR(filter.surprise(found), 12.0 * std::log(1.0 + 3.0), 1e-3) << "of P information^-1 = 3 along each axis";
  found.information.setZero();
  // One conditional standard deviation of the rate of yaw, all else as predicted.
  found.twist_base[5] += 1.0 / std::sqrt(P.inverse()(11, 11));
  EXPECT_NEAR(filter.surprise(found), 10.0 * std::log(1.0 + 1.0 / 4.0), 1e-3);
}

TEST(MotionFilter, ExpectedTurnChangesTheYawRateAndDoubtsTheYaw) {
  GaussianRobot robot(winding, {}, 1);
  MotionFilter as_before = begun_with(robot, winding);
  as_before.predict(0.1, 0.1, std::nullopt, {});
  MotionFilter turned = as_before;
  turned.expect_turn(2.0, 0.5);
  EXPECT_DOUBLE_EQ(turned.twist_base()[5], as_before.twist_base()[5] + 2.0);
  EXPECT_EQ(turned.twist_base().head<5>(), as_before.twist_base().head<5>());
  EXPECT_DOUBLE_EQ(turned.covariance()(11, 11), 0.25);
  as_before.move();
  turned.move();
  const Vector6 apart = difference(turned.pose(), as_before.pose());
  EXPECT_NEAR(apart.tail<3>().norm(), 0.2, 1e-3) << "2 rad/s for 0.1 s";
  const Matrix12 more = turned.covariance() - as_before.covariance();
  EXPECT_GT(more(5, 5), 0.01) << "of the yaw";
  EXPECT_NEAR(more(3, 3), 0.0, 1e-3) << "of the roll";
}

// --- Unobserved axes ----------------------------------------------------------------------------------------------

/// Wheels are the only source along x: their own measurements must not change their scale.
TEST(MotionFilter, WheelScaleIsRetainedInATunnel) {
  constexpr double kSpeed_mps = 1.5, kTime_s = 300.0;
  for (unsigned seed = 1; seed <= 5; ++seed) {
    GaussianRobot robot(straight(kSpeed_mps), {}, seed);
    MotionFilter filter = begun_with(robot, straight(kSpeed_mps));
    sweep_for(kTime_s, filter, robot, 0.1, {.lidar = blind_ahead(usual_lidar(0.1))});
    const double off_m = std::abs(error_of(filter, robot)[kX]);
    EXPECT_LT(off_m, 0.03 * kSpeed_mps * kTime_s) << "scale " << filter.state()[filter.state_of(kWheelSource)];
    EXPECT_LT(off_m, kSigmas * std::sqrt(filter.pose_covariance_since_start()(kX, kX)));
  }
}

TEST(MotionFilter, WheelScaleErrorInATunnelIsWithinSigma) {
  constexpr double kSpeed_mps = 1.5, kTime_s = 300.0;
  GaussianRobot robot(straight(kSpeed_mps), {.scale = 0.05}, 1);
  MotionFilter filter = begun_with(robot, straight(kSpeed_mps));
  sweep_for(kTime_s, filter, robot, 0.1, {.lidar = blind_ahead(usual_lidar(0.1))});
  EXPECT_LT(std::abs(error_of(filter, robot)[kX]), kSigmas * std::sqrt(filter.pose_covariance_since_start()(kX, kX)));
}

/// A gait: speeds up, slows down and pitches twice a second.
Vector6 walking(double t) {
  const double phase = 4.0 * std::numbers::pi * t;
  return twist_of(1.0 + 0.2 * std::sin(phase), 0, 0, 0, 0.5 * std::cos(phase), 0);
}

/// Regression: the weight of the integrated force decreased with its change, so that braking counted more than speeding
/// up, and the estimate stood still while the robot walked on.
TEST(MotionFilter, UnobservedForwardSpeedPersists) {
  constexpr double kPeriod_s = 0.05, kTime_s = 3.0;
  GaussianRobot robot(walking, {.lever_m = {0.1, 0.0, 0.3}}, 1);
  MotionFilter filter = begun_with(robot, walking);
  const Sensing lidar{.wheels = false, .force = true, .lidar = usual_lidar(kPeriod_s)};
  sweep_for(20.0, filter, robot, kPeriod_s, lidar);
  sweep_for(kTime_s, filter, robot, kPeriod_s, {.wheels = false, .force = true, .lidar = blind_ahead(*lidar.lidar)});
  EXPECT_LT(std::abs(error_of(filter, robot)[kX]), 0.05 * kTime_s);
  EXPECT_LT(std::abs(error_of(filter, robot)[kX]), kSigmas * sigma_of(filter, kX));
}

Vector6 speeding_up_from_the_fifth_second(double t) {
  return twist_of(1.0 + std::clamp(t - 5.0, 0.0, 5.0), 0, 0, 0, 0, 0);
}

/// Five seconds of sweeps are lost while the robot accelerates from 1 to 6 m/s; the force is that of the last sweep.
class Gap {
 public:
  static constexpr double kGap_s = 5.0, kPeriod_s = 0.1;

  explicit Gap(const Sensing& sensing)
      : sensing_(sensing), robot_(speeding_up_from_the_fifth_second, {}, 1),
        filter_(begun_with(robot_, speeding_up_from_the_fifth_second)) {
    Sensing seen = sensing;
    seen.lidar = usual_lidar(kPeriod_s);
    sweep_for(5.0, filter_, robot_, kPeriod_s, seen);
    step(kGap_s);
  }

  void step(double elapsed_s) {
    robot_.move(elapsed_s);
    filter_.predict(elapsed_s, kPeriod_s, sensing_.force ? std::optional(robot_.force()) : std::nullopt,
                    {.translation = sensing_.wheels, .rotation = sensing_.wheels});
    if (sensing_.wheels)
      filter_.measure(kWheelSource, robot_.wheels(), kAll);
    filter_.move();
  }
  void look() { see(filter_, robot_, usual_lidar(kPeriod_s)); }
  void expect_covered(const char* when) const {
    const Vector12 error = error_of(filter_, robot_);
    for (int axis = 0; axis < 12; ++axis)
      EXPECT_LT(std::abs(error[axis]), kSigmas * sigma_of(filter_, axis)) << when << ", axis " << axis;
  }

 private:
  Sensing sensing_;
  GaussianRobot robot_;
  MotionFilter filter_;
};

const std::vector<std::pair<const char*, Sensing>> kInAGap{{"nothing", {.wheels = false, .gyro = false}},
                                                           {"force", {.wheels = false, .gyro = false, .force = true}},
                                                           {"wheels", {.wheels = true, .gyro = false}}};

TEST(MotionFilter, IsConsistentAfterAGapWithAcceleration) {
  for (const auto& [what, sensing] : kInAGap)
    Gap(sensing).expect_covered(what);
}

TEST(MotionFilter, IsConsistentAtTheFirstUpdateAfterAGap) {
  for (const auto& [what, sensing] : kInAGap) {
    Gap gap(sensing);
    gap.look();
    gap.expect_covered(what);
  }
}

TEST(MotionFilter, IsConsistentInTheSweepAfterAGap) {
  for (const auto& [what, sensing] : kInAGap) {
    Gap gap(sensing);
    gap.look();
    gap.step(Gap::kPeriod_s);
    gap.expect_covered(what);
  }
}

/// Unobserved: the robot may have stopped at once or continued at its speed, and the covariance must cover both.
TEST(MotionFilter, UnobservedTwistDecaysAndItsVarianceCoversMotion) {
  constexpr double kSpeed_mps = 1.0, kTime_s = 3.0;
  for (const double rate_hz : kRates_hz) {
    GaussianRobot robot(straight(kSpeed_mps), {}, 1);
    MotionFilter filter = begun_with(robot, straight(kSpeed_mps));
    const Sensing unseen{.wheels = false, .gyro = false};
    Sensing seen = unseen;
    seen.lidar = usual_lidar(1.0 / rate_hz);
    sweep_for(5.0, filter, robot, 1.0 / rate_hz, seen);
    const double begin_m = robot.pose().translation.x();
    sweep_for(kTime_s, filter, robot, 1.0 / rate_hz, unseen);
    EXPECT_LT(filter.twist_base().head<3>().norm(), kSpeed_mps / 20) << rate_hz << " Hz";
    for (const double way_m : {0.0, kSpeed_mps * kTime_s})
      EXPECT_LT(std::abs(filter.pose().translation.x() - begin_m - way_m), kSigmas * sigma_of(filter, kX))
          << rate_hz << " Hz, " << way_m << " m";
    for (const double speed_mps : {0.0, kSpeed_mps})
      EXPECT_LT(std::abs(filter.twist_base()[kX] - speed_mps), kSigmas * sigma_of(filter, 6 + kX))
          << rate_hz << " Hz, " << speed_mps << " m/s";
  }
}

TEST(MotionFilter, RestHasZeroTwist) {
  MotionFilter filter = begun(twist_of(0.3, 0.1, -0.1, 0.1, -0.1, 0.2), along_each_axis(0.5, 20.0));
  filter.predict(0.1, 0.1, std::nullopt, kNothing);
  filter.rest();
  filter.move();
  for (int axis = 0; axis < 6; ++axis) {
    EXPECT_LT(std::abs(filter.twist_base()[axis]), 1e-4) << axis;
    EXPECT_LT(sigma_of(filter, 6 + axis), 1.1e-3) << axis;
  }
}

// --- The map ------------------------------------------------------------------------------------------------------

/// Transferring a share of the pose error to the map reduces the covariance against the map; that since the start is
/// unchanged.
TEST(MotionFilter, ErrorTransferredToTheMapRemainsInTheTotal) {
  for (const double share : {0.0, 0.1, 0.5, 1.0}) {
    MotionFilter filter = begun(twist_of(1, 0, 0, 0, 0, 0.2));
    GaussianRobot robot(straight(1.0), {}, 1);
    sweep_for(1.0, filter, robot, 0.1, {}); // unobserved: far above the floor of the pose
    const Matrix6 before = filter.pose_covariance_since_start();
    const double against_map = filter.covariance()(kX, kX);
    filter.transfer_error_to_map(share * Matrix6::Identity());
    const Matrix6 after = filter.pose_covariance_since_start();
    const Vector6 floor = along_each_axis(0.001, 1e-4 / kRadPerDeg).cwiseAbs2(); // the surfaces' own uncertainty
    for (int axis = 0; axis < 6; ++axis)
      EXPECT_NEAR(after(axis, axis), before(axis, axis), 1e-9 + floor[axis]) << share << ", axis " << axis;
    EXPECT_NEAR(filter.covariance()(kX, kX), std::max(floor[kX], (1 - share) * (1 - share) * against_map), 1e-9);
  }
}

TEST(MotionFilter, CovarianceSinceStartIsAtLeastThatAgainstTheMap) {
  GaussianRobot robot(straight(1.5), {}, 1);
  MotionFilter filter = begun_with(robot, straight(1.5));
  double last = 0.0;
  for (int keyframe = 0; keyframe < 50; ++keyframe) {
    sweep_for(1.0, filter, robot, 0.1, {.lidar = usual_lidar(0.1)});
    filter.transfer_error_to_map(0.2 * Matrix6::Identity());
    const Matrix6 more = filter.pose_covariance_since_start() - filter.covariance().topLeftCorner<6, 6>();
    EXPECT_GT(Eigen::SelfAdjointEigenSolver<Matrix6>(more).eigenvalues()[0], -1e-9);
    EXPECT_GT(more(kX, kX), last) << "the map drifts";
    last = more(kX, kX);
  }
}

/// Prior of the lidar extrinsics: two milliradians and five millimetres.
TEST(MotionFilter, ExtrinsicsErrorAppearsInThePoseCovariance) {
  MotionFilter filter = begun(Vector6::Zero());
  const Matrix6 at_start = filter.pose_covariance_since_start();
  const auto sigma_at = [&](const Pose& pose) {
    filter.set_pose(pose);
    return (filter.pose_covariance_since_start() - at_start).diagonal().cwiseMax(0.0).cwiseSqrt().eval();
  };
  EXPECT_TRUE(sigma_at(Pose{}).isZero(1e-9));
  const Vector6 straight_on = sigma_at({Eigen::Quaterniond::Identity(), {10, 0, 0}});
  EXPECT_TRUE(straight_on.isApprox(twist_of(0, 0.05, 0.05, 0, 0, 0), 1e-6)) << straight_on.transpose();
  const Vector6 turned_round = sigma_at({so3_exp({0, 0, 180 * kRadPerDeg}), {0, 0, 0}});
  EXPECT_TRUE(turned_round.isApprox(twist_of(0.012, 0.012, 0, 0.01, 0.01, 0), 1e-6)) << turned_round.transpose();
}

// --- Motion limits -------------------------------------------------------------------------------------------------

/// Returns the predicted speed 1 ms after 14 m/s was measured with this standard deviation.
double speed_after_a_move(const MotionLimits& limits, double sigma_mps) {
  MotionFilter filter(wheels_and_gyro(), limits);
  filter.begin(Pose{}, twist_of(14, 0, 0, 0, 0, 0), along_each_axis(sigma_mps, 1.0));
  filter.predict(1e-3, 1e-3, std::nullopt, kNothing);
  filter.move();
  return filter.twist_base().head<3>().norm();
}

TEST(MotionFilter, SpeedAboveTheLimitIsPredictedOnlyIfCertain) {
  EXPECT_LT(speed_after_a_move({}, 10.0), 11.0);
  EXPECT_GT(speed_after_a_move({}, 0.5), 13.9);
  EXPECT_DOUBLE_EQ(speed_after_a_move({.max_speed_mps = 40.0}, 10.0), 14.0);
}

TEST(MotionFilter, LidarUpdateMayExceedTheSpeedLimit) {
  for (const double max_mps : {0.1, 1.0, 10.0, 40.0}) {
    GaussianRobot robot(straight(14.0), {}, 1);
    MotionFilter filter(wheels_and_gyro(), {.max_speed_mps = max_mps});
    filter.begin(Pose{}, twist_of(14, 0, 0, 0, 0, 0), along_each_axis(0.05, 0.1));
    sweep_for(1.0, filter, robot, 0.1, {.wheels = false, .gyro = false, .lidar = usual_lidar(0.1)});
    EXPECT_NEAR(filter.pose().translation.x(), 14.0, 0.05) << max_mps;
  }
}

TEST(MotionFilter, HigherLimitsAllowMoreMotion) {
  const auto doubt_mps = [](const MotionLimits& limits) {
    MotionFilter filter(wheels_and_gyro(), limits);
    filter.begin(Pose{}, Vector6::Zero(), Vector6::Zero());
    filter.predict(0.1, 0.1, std::nullopt, kTranslation);
    return std::sqrt(filter.covariance()(6 + kX, 6 + kX));
  };
  EXPECT_NEAR(doubt_mps({.max_acceleration_mps2 = 30.0}), 3.0 * doubt_mps({}), 1e-9);
}

/// The probability that no slip begins in two intervals is the product of the two, also beyond ten seconds.
TEST(MotionFilter, OddsOfASlipComposeOverTime) {
  const auto none_begins_in = [](double elapsed_s) {
    MotionFilter filter{{}};
    filter.begin({}, Vector6::Zero(), Vector6::Ones());
    filter.predict(elapsed_s, elapsed_s, {}, {});
    return 1.0 / (1.0 + std::exp(-0.5 * filter.odds_against_slip()));
  };
  for (const double elapsed_s : {0.05, 0.1, 3.0, 15.0, 60.0})
    EXPECT_NEAR(none_begins_in(2.0 * elapsed_s), std::pow(none_begins_in(elapsed_s), 2), 1e-12) << elapsed_s;
  EXPECT_GT(none_begins_in(0.1), 0.98);
}

TEST(MotionFilter, SetPoseChangesThePoseOnly) {
  MotionFilter filter = begun(twist_of(1, 0, 0, 0, 0, 0));
  const Matrix12 before = filter.covariance();
  const Pose elsewhere{so3_exp({0, 0, 0.1}), {1, 2, 3}};
  filter.set_pose(elsewhere);
  EXPECT_EQ(filter.pose(), elsewhere);
  EXPECT_EQ(filter.covariance(), before);
  EXPECT_EQ(filter.twist_base(), twist_of(1, 0, 0, 0, 0, 0));
}

// --- Numbers ------------------------------------------------------------------------------------------------------

/// Arbitrary events in arbitrary order, as in the life of a robot.
class AnyDay {
 public:
  explicit AnyDay(unsigned seed) : robot_(winding, {}, seed), random_(seed) {}

  void sweep(MotionFilter& filter) {
    const double elapsed_s = std::array{1e-6, 0.05, 0.1, 0.1, 0.1, 0.1, 0.3, 2.0}[any(8)];
    robot_.move(elapsed_s);
    filter.predict(elapsed_s, 0.1, maybe() ? std::optional(robot_.force()) : std::nullopt,
                   {.translation = maybe(), .rotation = maybe()});
    if (maybe())
      filter.measure(kGyroSource, robot_.gyro(), kRotation);
    if (maybe())
      filter.measure(kWheelSource, robot_.wheels(), std::array{kTranslation, kRotation, kAll}[any(3)]);
    const std::size_t what = any(10);
    if (what == 7)
      filter.rest();
    filter.move();
    if (what < 5)
      see(filter, robot_, usual_lidar(std::max(elapsed_s, 0.05)));
    else if (what < 7)
      see(filter, robot_, blind_ahead(usual_lidar(std::max(elapsed_s, 0.05))));
    if (maybe())
      filter.learn();
    if (any(5) == 0)
      filter.transfer_error_to_map(0.1 * static_cast<double>(any(11)) * Matrix6::Identity());
    if (any(100) == 0)
      filter.reset_source(SourceId{any(2)});
    if (any(100) == 0)
      filter.set_pose(robot_.pose());
  }

 private:
  std::size_t any(std::size_t count) { return random_() % count; }
  bool maybe() { return any(2) == 0; }

  GaussianRobot robot_;
  std::mt19937 random_;
};

TEST(MotionFilter, CovarianceStaysValidForAnyInput) {
  for (unsigned seed = 1; seed <= 3; ++seed) {
    AnyDay day(seed);
    MotionFilter filter = begun(winding(0.0));
    for (int i = 0; i < 10'000; ++i) {
      day.sweep(filter);
      ASSERT_TRUE(is_sound(filter.covariance())) << "sweep " << i << "\n" << filter.covariance();
      ASSERT_TRUE(filter.pose_covariance_since_start().allFinite());
      ASSERT_TRUE(filter.pose().finite() && filter.twist_base().allFinite() && filter.state().allFinite());
    }
  }
}

TEST(MotionFilter, CovarianceStaysValidOverAnHourInATunnel) {
  GaussianRobot robot(straight(1.5), {}, 1);
  MotionFilter filter = begun_with(robot, straight(1.5));
  for (int minute = 0; minute < 60; ++minute) {
    sweep_for(60.0, filter, robot, 0.1, {.force = true, .lidar = blind_ahead(usual_lidar(0.1))});
    ASSERT_TRUE(is_sound(filter.covariance())) << minute << " min\n" << filter.covariance();
  }
}

TEST(MotionFilter, MicrosecondSweepsStayFinite) {
  constexpr double kMoment_s = 1e-6;
  for (const bool force : {false, true}) {
    GaussianRobot robot(winding, {}, 1);
    MotionFilter filter = begun_with(robot, winding);
    const auto expect_figures = [&] {
      EXPECT_TRUE(filter.pose().finite() && filter.twist_base().allFinite() && filter.state().allFinite());
      EXPECT_TRUE(is_sound(filter.covariance())) << filter.covariance();
      EXPECT_TRUE(filter.belief().information.allFinite());
      const Innovation found = filter.innovation(kWheelSource, robot.twist());
      EXPECT_TRUE(found.value.allFinite() && found.variance.allFinite());
    };
    for (int i = 0; i < 20; ++i) {
      sweep(filter, robot, kMoment_s, {.force = force, .lidar = usual_lidar(0.1)});
      expect_figures();
    }
    sweep(filter, robot, 0.1, {.force = force, .lidar = usual_lidar(0.1)});
    expect_figures();
    sweep(filter, robot, kMoment_s, {.force = force});
    expect_figures();
  }
}

TEST(MotionFilter, CopyWithTheSameInputIsBitIdentical) {
  AnyDay day(7), same_day(7);
  MotionFilter filter = begun(winding(0.0));
  for (int i = 0; i < 100; ++i) {
    day.sweep(filter);
    MotionFilter unused = begun(winding(0.0));
    same_day.sweep(unused);
  }
  // Both days have the same sequence of events only if no event depends on the filter's state.
  MotionFilter copy = filter;
  for (int i = 0; i < 100; ++i) {
    day.sweep(filter);
    same_day.sweep(copy);
    ASSERT_EQ(filter.pose(), copy.pose());
    ASSERT_EQ(filter.twist_base(), copy.twist_base());
    ASSERT_EQ(filter.state(), copy.state());
    ASSERT_EQ(filter.covariance(), copy.covariance());
    ASSERT_EQ(filter.pose_covariance_since_start(), copy.pose_covariance_since_start());
  }
}

} // namespace
} // namespace locus::test
