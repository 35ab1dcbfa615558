// SPDX-License-Identifier: Apache-2.0
// Calibration and noise of the motion sources as the filter estimates and reports them.
#include "core/odometry/motion_filter.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <optional>
#include <utility>
#include <vector>

#include "core/odometry/gaussian_robot.hpp"

namespace locus::test {
namespace {

// --- Estimated errors of the sensors ------------------------------------------------------------------------------

/// The rotation measured by lidar over this time determines the bias as well as the gyro's own noise allows.
TEST(MotionFilter, EstimatesGyroBias) {
  constexpr double kTime_s = 60.0;
  const Eigen::Vector3d bias{0.01, -0.015, 0.02};
  for (const double rate_hz : kRates_hz) {
    GaussianRobot robot(winding, {.bias_radps = bias}, 1);
    MotionFilter filter = begun_with(robot, winding);
    sweep_for(kTime_s, filter, robot, 1.0 / rate_hz, {.wheels = false, .lidar = usual_lidar(1.0 / rate_hz)});
    const Eigen::Vector3d found = filter.state().segment<3>(filter.state_of(kGyroSource));
    EXPECT_LT((found - bias).cwiseAbs().maxCoeff(), kSigmas * kUsualGyro[kYaw] / std::sqrt(kTime_s))
        << rate_hz << " Hz";
  }
}

TEST(MotionFilter, EstimatesWheelScaleIfLidarObservesAllAxes) {
  constexpr double kTime_s = 60.0, kSpeed_mps = 1.5, kScale = 0.04;
  for (const double rate_hz : kRates_hz) {
    GaussianRobot robot(straight(kSpeed_mps), {.scale = kScale}, 1);
    MotionFilter filter = begun_with(robot, straight(kSpeed_mps));
    sweep_for(kTime_s, filter, robot, 1.0 / rate_hz, {.lidar = usual_lidar(1.0 / rate_hz)});
    const double way_sigma = kUsualWheels[kX] * std::sqrt(kTime_s);
    EXPECT_NEAR(filter.state()[filter.state_of(kWheelSource)], kScale, kSigmas * way_sigma / (kSpeed_mps * kTime_s))
        << rate_hz << " Hz";
  }
}

/// Odometry misaligned by half a degree: its direction of travel matters for dead reckoning without lidar.
TEST(MotionFilter, EstimatesTheForwardDirectionOfAnOdometry) {
  constexpr double kTime_s = 60.0, kSpeed_mps = 1.5, kToTheLeft = 0.015, kUpwards = -0.01;
  for (const double rate_hz : kRates_hz) {
    GaussianRobot robot(straight(kSpeed_mps), {.to_the_left = kToTheLeft, .upwards = kUpwards}, 1);
    MotionFilter filter = begun_with(robot, straight(kSpeed_mps));
    sweep_for(kTime_s, filter, robot, 1.0 / rate_hz, {.lidar = usual_lidar(1.0 / rate_hz)});
    const Eigen::Vector2d found = filter.state().segment<2>(filter.state_of(kWheelSource) + 2);
    const double sigma = kUsualWheels[kX] * std::sqrt(kTime_s) / (kSpeed_mps * kTime_s);
    EXPECT_NEAR(found.x(), kToTheLeft, kSigmas * sigma) << rate_hz << " Hz";
    EXPECT_NEAR(found.y(), kUpwards, kSigmas * sigma) << rate_hz << " Hz";
  }
}

/// Mean over 30 s of the learned noise, in units of the true one. Lidar is more precise than the source.
Vector6 learned_noise(double rate_hz, SourceId source, const GaussianRobot::Sensors& sensors) {
  const double elapsed_s = 1.0 / rate_hz;
  const Vector6 sharp = along_each_axis(0.001, 0.0002 / kRadPerDeg);
  const bool gyro = source == kGyroSource;
  const Sensing sensing{.wheels = !gyro, .gyro = gyro, .lidar = lidar_with(sharp, 3.0 / elapsed_s * sharp)};
  GaussianRobot robot(creeping, sensors, 1);
  MotionFilter filter = begun_with(robot, creeping);
  sweep_for(60.0, filter, robot, elapsed_s, sensing);
  Vector6 sum = Vector6::Zero();
  const auto count = static_cast<int>(30 * rate_hz);
  for (int i = 0; i < count; ++i) {
    sweep(filter, robot, elapsed_s, sensing);
    sum += noise_of(filter, source, robot.twist(), elapsed_s) / count;
  }
  const Vector6 truth = (gyro ? sensors.gyro : sensors.wheels).cwiseAbs2();
  return (truth.array() > 0.0).select(sum.array() / truth.array(), 1.0);
}

void expect_learned(SourceId source, const GaussianRobot::Sensors& sensors) {
  for (const double rate_hz : kRates_hz) {
    const Vector6 found = learned_noise(rate_hz, source, sensors);
    for (int axis = 0; axis < 6; ++axis) {
      EXPECT_LT(found[axis], kLearned) << rate_hz << " Hz, axis " << axis;
      EXPECT_GT(found[axis], 1.0 / kLearned) << rate_hz << " Hz, axis " << axis;
    }
  }
}

// The floors are 6 mm and 1 mrad for odometry, 1 mrad for a gyro.
TEST(MotionFilter, LearnsHighWheelNoise) { expect_learned(kWheelSource, {.wheels = 10.0 * kUsualWheels}); }
TEST(MotionFilter, LearnsLowWheelNoise) {
  expect_learned(kWheelSource, {.wheels = along_each_axis(0.006, 0.001 / kRadPerDeg)});
}
TEST(MotionFilter, LearnsHighGyroNoise) { expect_learned(kGyroSource, {.gyro = 10.0 * kUsualGyro}); }
TEST(MotionFilter, LearnsLowGyroNoise) {
  expect_learned(kGyroSource, {.gyro = along_each_axis(0.0, 0.001 / kRadPerDeg)});
}

/// Two sources of ordinary noise and no third measurement: neither estimate of their noise may change.
TEST(MotionFilter, LearnsNoNoiseWithoutAReference) {
  for (const double rate_hz : kRates_hz) {
    const double elapsed_s = 1.0 / rate_hz;
    for (const bool gyro : {false, true}) {
      GaussianRobot robot(straight(1.0), {}, 1);
      MotionFilter filter = begun_with(robot, straight(1.0));
      sweep_for(300.0, filter, robot, elapsed_s, {.wheels = !gyro, .gyro = gyro});
      const Vector6 noise = noise_of(filter, gyro ? kGyroSource : kWheelSource, robot.twist(), elapsed_s);
      const Vector6 usual = (gyro ? kUsualGyro : kUsualWheels).cwiseAbs2();
      for (int axis = gyro ? 3 : 0; axis < 6; ++axis) {
        EXPECT_GT(noise[axis] / usual[axis], 1.0 / kLearned) << rate_hz << " Hz, gyro " << gyro << ", axis " << axis;
        EXPECT_LT(noise[axis] / usual[axis], kLearned) << rate_hz << " Hz, gyro " << gyro << ", axis " << axis;
      }
    }
  }
}

TEST(MotionFilter, LearnsNoWheelNoiseAlongAnUnobservedAxis) {
  for (const double rate_hz : kRates_hz) {
    const double elapsed_s = 1.0 / rate_hz;
    GaussianRobot robot(straight(1.0), {}, 1);
    MotionFilter filter = begun_with(robot, straight(1.0));
    sweep_for(300.0, filter, robot, elapsed_s, {.lidar = blind_ahead(usual_lidar(elapsed_s))});
    const double noise =
        noise_of(filter, kWheelSource, robot.twist(), elapsed_s)[kX] / (kUsualWheels[kX] * kUsualWheels[kX]);
    EXPECT_GT(noise, 1.0 / kLearned) << rate_hz << " Hz";
    EXPECT_LT(noise, kLearned) << rate_hz << " Hz";
  }
}

TEST(MotionFilter, ResetSourceRestoresThePriors) {
  GaussianRobot robot(
      straight(1.5),
      {.wheels = 5.0 * kUsualWheels, .gyro = 5.0 * kUsualGyro, .scale = 0.04, .bias_radps = {0.01, 0.01, 0.01}}, 1);
  MotionFilter filter = begun_with(robot, straight(1.5));
  sweep_for(30.0, filter, robot, 0.1, {.lidar = usual_lidar(0.1)});
  ASSERT_GT(noise_of(filter, kWheelSource, robot.twist(), 0.1)[kX], 5.0 * kUsualWheels[kX] * kUsualWheels[kX]);
  const Matrix12 before = filter.covariance();
  const Eigen::Vector3d bias = filter.state().segment<3>(filter.state_of(kGyroSource));
  filter.reset_source(kWheelSource);
  EXPECT_EQ(filter.state().segment<2>(filter.state_of(kWheelSource)), Eigen::Vector2d::Zero());
  EXPECT_EQ(filter.state().segment<3>(filter.state_of(kGyroSource)), bias) << "another one";
  filter.reset_source(kGyroSource);
  EXPECT_EQ(filter.state().segment<3>(filter.state_of(kGyroSource)), Eigen::Vector3d::Zero());
  EXPECT_EQ(filter.covariance(), before) << "where the robot is is as well known";
  filter.predict(0.1, 0.1, std::nullopt, kNothing);
  filter.move();
  for (const auto& [source, usual, first] :
       {std::tuple(kWheelSource, kUsualWheels, 0), std::tuple(kGyroSource, kUsualGyro, 3)})
    for (int axis = first; axis < 6; ++axis)
      EXPECT_NEAR(noise_of(filter, source, robot.twist(), 0.1)[axis], usual[axis] * usual[axis], 1e-12) << axis;
}

/// Rotates about all axes at the rates of a legged robot.
Vector6 swaying(double t) {
  return twist_of(1.0, 0, 0, 0.5 * std::sin(3.0 * t), 0.4 * std::sin(2.3 * t), 0.6 * std::sin(1.1 * t));
}

LearnedSource learned_of_gyro(const Motion& motion, const GaussianRobot::Sensors& sensors, unsigned seed,
                              double time_s = 60.0) {
  GaussianRobot robot(motion, sensors, seed);
  MotionFilter filter = begun_with(robot, motion);
  sweep_for(time_s, filter, robot, 0.1, {.wheels = false, .lidar = usual_lidar(0.1)});
  return filter.learned(kGyroSource);
}

/// Corrects the stamps by the estimated lateness, as the estimator does.
TEST(MotionFilter, EstimatesGyroLateness) {
  for (const double late_s : {-0.1, -0.04, 0.0, 0.01, 0.04, 0.1})
    for (unsigned seed = 1; seed <= 5; ++seed) {
      GaussianRobot robot(swaying, {.late_s = late_s}, seed);
      MotionFilter filter = begun_with(robot, swaying);
      Learned found = filter.learned(kGyroSource).lateness_s();
      for (int i = 0; i < 600; ++i) {
        robot.move(0.1);
        filter.predict(0.1, 0.1, std::nullopt, kRotation);
        filter.measure(kGyroSource, robot.gyro(found.sigma < 0.005 ? found.mean : 0.0), kRotation);
        filter.move();
        see(filter, robot, usual_lidar(0.1));
        filter.learn();
        found = filter.learned(kGyroSource).lateness_s();
      }
      const bool is_linear = std::abs(late_s) < 0.1; // at a whole sweep: slower than its sigma says
      EXPECT_NEAR(found.mean, late_s, is_linear ? kSigmas * found.sigma : 0.015) << "seed " << seed;
      EXPECT_LT(found.sigma, 0.002);
    }
}

TEST(MotionFilter, EstimatesGyroMounting) {
  for (unsigned seed = 1; seed <= 5; ++seed) {
    const Eigen::Vector3d mounting_rad = kRadPerDeg * Eigen::Vector3d{5.0, -4.0, 3.0};
    const LearnedSource found = learned_of_gyro(swaying, {.mounting_rad = mounting_rad}, seed);
    for (int axis = 0; axis < 3; ++axis) {
      EXPECT_NEAR(found.mounting_rad(axis).mean, mounting_rad[axis], 0.3 * kRadPerDeg) << "seed " << seed;
      EXPECT_LT(found.mounting_rad(axis).sigma, 0.3 * kRadPerDeg);
    }
  }
}

/// Unobservable states must not move by more than their prior uncertainty.
TEST(MotionFilter, StraightMotionDoesNotObserveGyroMountingAndLateness) {
  for (unsigned seed = 1; seed <= 10; ++seed) {
    const LearnedSource found =
        learned_of_gyro(straight(1.5), {.late_s = 0.04, .mounting_rad = {0.05, 0.05, 0.05}}, seed, 300.0);
    EXPECT_LT(std::abs(found.lateness_s().mean), 0.03) << "seed " << seed;
    for (int axis = 0; axis < 3; ++axis)
      EXPECT_LT(std::abs(found.mounting_rad(axis).mean), 0.03) << "seed " << seed;
  }
}

TEST(MotionFilter, AppliedLatenessDoesNotChangeTheEstimate) {
  GaussianRobot robot(swaying, {.late_s = 0.04}, 1);
  MotionFilter filter = begun_with(robot, swaying);
  sweep_for(60.0, filter, robot, 0.1, {.wheels = false, .lidar = usual_lidar(0.1)});
  robot.move(0.1);
  const SensedTwist raw = robot.gyro();
  SensedTwist brought_forward = raw;
  brought_forward.brought_forward = 0.04 * raw.change_per_s;
  brought_forward.mean += brought_forward.brought_forward;
  filter.predict(0.1, 0.1, std::nullopt, kRotation);
  const Innovation one = filter.innovation(kGyroSource, raw), other = filter.innovation(kGyroSource, brought_forward);
  EXPECT_GT(brought_forward.brought_forward.norm(), 0.01);
  EXPECT_LT((one.value - other.value).norm(), 0.01 * brought_forward.brought_forward.norm()) << "of the mounting";
}

std::vector<MotionSourceOptions> wheels_and_gyro_with(const std::function<void(MotionSourceOptions&)>& change) {
  std::vector<MotionSourceOptions> sources = wheels_and_gyro();
  std::ranges::for_each(sources, change);
  return sources;
}

LearnedSource learned_of_gyro_as(const std::vector<MotionSourceOptions>& sources) {
  GaussianRobot robot(swaying, {.late_s = 0.04, .mounting_rad = {0.05, 0.05, 0.05}}, 1);
  MotionFilter filter(sources);
  filter.begin(Pose{}, swaying(robot.t_s()), along_each_axis(0.05, 1.0));
  sweep_for(60.0, filter, robot, 0.1, {.lidar = usual_lidar(0.1)});
  return filter.learned(kGyroSource);
}

TEST(MotionFilter, CalibrationThatIsOffStaysAsConfigured) {
  for (const Calibration mode : {Calibration::off, Calibration::report}) {
    const LearnedSource fixed = learned_of_gyro_as(wheels_and_gyro_with([&](MotionSourceOptions& source) {
      source.late_ms = 30.0;
      source.calibration = mode;
    }));
    EXPECT_EQ(fixed.lateness_s().mean, 0.03);
    EXPECT_EQ(fixed.lateness_s().sigma, 0.0);
    EXPECT_EQ(fixed.mounting_rad(0).mean, 0.0);
    EXPECT_GT(fixed.states.head<3>().norm(), 0.0) << "of the bias nothing is configured";
  }
}

/// Values configured as exact are not estimated, each on its own.
TEST(MotionFilter, ExactCalibrationIsNotChanged) {
  const LearnedSource found = learned_of_gyro_as(wheels_and_gyro_with([](MotionSourceOptions& source) {
    if (source.kind == SourceKind::imu)
      source.calibration_sigma.mounting_deg = 0.0;
  }));
  EXPECT_EQ(found.mounting_rad(1).mean, 0.0);
  EXPECT_GT(found.lateness_s().mean, 0.02);
}

TEST(MotionFilter, RecalledCalibrationIsAged) {
  MotionFilter filter(wheels_and_gyro());
  LearnedSource learned = as_configured(wheels_and_gyro()[1]);
  const double before = learned.mounting_rad(0).sigma;
  learned.states[LearnedSource::kMounting] = 0.05;
  learned.covariance *= 1e-4;
  filter.recall(kGyroSource, learned, 0.0);
  EXPECT_EQ(filter.learned(kGyroSource).mounting_rad(0).mean, 0.05);
  EXPECT_NEAR(filter.learned(kGyroSource).mounting_rad(0).sigma, 0.01 * before, 1e-9);
  filter.recall(kGyroSource, learned, 86400.0);
  EXPECT_NEAR(filter.learned(kGyroSource).mounting_rad(0).mean, 0.05, 0.002);
  EXPECT_GT(filter.learned(kGyroSource).mounting_rad(0).sigma, 0.1 * before);
  filter.recall(kGyroSource, learned, 1e9);
  EXPECT_NEAR(filter.learned(kGyroSource).mounting_rad(0).mean, 0.0, 1e-9) << "as configured";
  EXPECT_NEAR(filter.learned(kGyroSource).mounting_rad(0).sigma, before, 1e-9) << "no worse than configured";
}

TEST(MotionFilter, ResetSourceRetainsLateness) {
  GaussianRobot robot(swaying, {.late_s = 0.04}, 1);
  MotionFilter filter = begun_with(robot, swaying);
  sweep_for(60.0, filter, robot, 0.1, {.wheels = false, .lidar = usual_lidar(0.1)});
  const LearnedSource before = filter.learned(kGyroSource);
  filter.reset_source(kGyroSource);
  const LearnedSource after = filter.learned(kGyroSource);
  EXPECT_EQ(after.lateness_s().mean, before.lateness_s().mean);
  EXPECT_EQ(after.mounting_rad(2).mean, before.mounting_rad(2).mean);
  EXPECT_GT(after.lateness_s().sigma, 10.0 * before.lateness_s().sigma) << "and it may have changed";
}

/// Wheels that begin to spin while the robot turns: their speed is open until lidar measures it, their turn is not.
TEST(MotionFilter, SlipFreesTheForwardSpeedUntilItIsMeasured) {
  constexpr double kElapsed_s = 0.1, kSpeed_mps = 1.0, kTurn_radps = 0.3;
  GaussianRobot robot(straight(kSpeed_mps), {}, 1);
  MotionFilter filter = begun_with(robot, straight(kSpeed_mps));
  while (robot.t_s() < 20.0)
    sweep(filter, robot, kElapsed_s, {.lidar = usual_lidar(kElapsed_s)});
  constexpr double kReading_mps = 1.8;
  const SensedTwist reading(twist_of(kReading_mps, 0, 0, 0, 0, kTurn_radps));
  const auto predict = [&](bool slips) {
    MotionFilter after = filter;
    after.predict(kElapsed_s, kElapsed_s, std::nullopt, kAll);
    after.measure(kWheelSource, reading, {.translation = true, .rotation = true, .slips = slips});
    after.move();
    return after;
  };
  EXPECT_GT(predict(false).twist_base()[kX], 1.3) << "else the test proves nothing";
  const MotionFilter open = predict(true);
  MotionFilter unmeasured = filter;
  unmeasured.predict(kElapsed_s, kElapsed_s, std::nullopt, kAll);
  const double predicted_mps = unmeasured.twist_base()[kX], variance = unmeasured.covariance()(6 + kX, 6 + kX);
  const double weight = variance / (variance + kReading_mps * kReading_mps);
  EXPECT_NEAR(open.twist_base()[kX], predicted_mps + weight * (kReading_mps - predicted_mps), 0.02);
  EXPECT_NEAR(open.twist_base()[kYaw], kTurn_radps, 0.03);
  EXPECT_GT(std::sqrt(open.covariance()(6 + kX, 6 + kX)), 0.3);

  filter = open;
  const Vector6 twist = twist_of(kSpeed_mps, 0, 0, 0, 0, kTurn_radps);
  const Pose T_odom_base =
      open.pose() * se3_exp(kElapsed_s * open.twist_base()).inverse() * se3_exp(kElapsed_s * twist);
  filter.update(T_odom_base, twist, usual_lidar(kElapsed_s));
  EXPECT_NEAR(predict(false).twist_base()[kX], kSpeed_mps, 0.1) << "the slip goes on";
}

/// Returns the largest forward error that one second of wheel spin causes.
double dragged_m(double rate_hz, unsigned seed, const Matrix12& lidar) {
  const auto spin = [](double t_s) { return t_s > 20.0 && t_s < 21.0 ? 0.6 : 0.0; };
  GaussianRobot sound(straight(1.0), {}, seed), spinning(straight(1.0), {.slip_mps = spin}, seed);
  MotionFilter as_it_is = begun_with(sound, straight(1.0)), told = begun_with(spinning, straight(1.0));
  double most_m = 0.0;
  while (sound.t_s() < 24.0) {
    sweep(as_it_is, sound, 1.0 / rate_hz, {.force = true, .lidar = lidar});
    sweep(told, spinning, 1.0 / rate_hz, {.force = true, .lidar = lidar});
    most_m = std::max(most_m, told.pose().translation.x() - as_it_is.pose().translation.x());
  }
  return most_m;
}

/// An open field: lidar measures the forward position to 0.1 m, and the spin causes no acceleration.
TEST(MotionFilter, LongSlipCountsAsOneFault) {
  std::vector<double> mean_m;
  for (const double rate_hz : kRates_hz) {
    Matrix12 lidar = usual_lidar(1.0 / rate_hz);
    lidar(kX, kX) /= 400.0;
    lidar(6 + kX, 6 + kX) = 0.0;
    mean_m.push_back(0.0);
    for (unsigned seed = 1; seed <= 20; ++seed)
      mean_m.back() += dragged_m(rate_hz, seed, lidar) / 20.0;
    EXPECT_LT(mean_m.back(), 0.1) << rate_hz << " Hz, of 0.6 m";
  }
  EXPECT_LT(mean_m.back(), 1.5 * mean_m.front()) << kRates_hz.back() / kRates_hz.front() << " times the sweeps";
}

// --- Reported source quality --------------------------------------------------------------------------------------

/// Squared innovation divided by its variance, mean over the second half of 20 drives of 20 s. A source that is not
/// measured throughout is measured in the first half, so that its bias is known.
Vector6 mean_ratio(double rate_hz, SourceId source, bool all_the_time) {
  Vector6 sum = Vector6::Zero();
  int count = 0;
  for (unsigned seed = 1; seed <= 20; ++seed) {
    GaussianRobot robot(creeping, {}, seed);
    MotionFilter filter = begun_with(robot, creeping);
    const double elapsed_s = 1.0 / rate_hz;
    for (int i = 0; i < static_cast<int>(20 * rate_hz); ++i) {
      const bool counts = i >= static_cast<int>(10 * rate_hz), measured = all_the_time || !counts;
      robot.move(elapsed_s);
      filter.predict(elapsed_s, elapsed_s, std::nullopt, measured ? kAll : kNothing);
      const SensedTwist said = source == kGyroSource ? robot.gyro() : SensedTwist(robot.wheels());
      if (measured)
        filter.measure(source, said, source == kGyroSource ? kRotation : kAll);
      filter.move();
      see(filter, robot, usual_lidar(elapsed_s));
      if (counts) {
        const Innovation found = filter.innovation(source, said);
        sum +=
            (found.variance.array() > 0.0).select(found.value.array().square() / found.variance.array(), 1.0).matrix();
        ++count;
      }
      filter.learn();
    }
  }
  return sum / count;
}

TEST(MotionFilter, HonestSourceHasConsistentInnovations) {
  for (const double rate_hz : kRates_hz)
    for (const SourceId source : {kWheelSource, kGyroSource}) {
      const Vector6 mean = mean_ratio(rate_hz, source, true);
      for (int axis = 0; axis < 6; ++axis) {
        EXPECT_GT(mean[axis], 0.7) << rate_hz << " Hz, source " << index_of(source) << ", axis " << axis;
        EXPECT_LT(mean[axis], 1.4) << rate_hz << " Hz, source " << index_of(source) << ", axis " << axis;
      }
    }
}

TEST(MotionFilter, HonestUnusedSourceHasConsistentInnovations) {
  for (const double rate_hz : kRates_hz)
    for (const SourceId source : {kWheelSource, kGyroSource}) {
      const Vector6 mean = mean_ratio(rate_hz, source, false);
      for (int axis = 0; axis < 6; ++axis) {
        EXPECT_GT(mean[axis], 0.7) << rate_hz << " Hz, source " << index_of(source) << ", axis " << axis;
        EXPECT_LT(mean[axis], 1.4) << rate_hz << " Hz, source " << index_of(source) << ", axis " << axis;
      }
    }
}

TEST(MotionFilter, WheelErrorOfOneMetrePerSecondIsDetected) {
  for (const double rate_hz : kRates_hz)
    for (const bool measured : {false, true}) {
      const double elapsed_s = 1.0 / rate_hz;
      GaussianRobot robot(straight(1.0), {}, 1);
      MotionFilter filter = begun_with(robot, straight(1.0));
      sweep_for(20.0, filter, robot, elapsed_s, {.lidar = usual_lidar(elapsed_s)});
      robot.move(elapsed_s);
      filter.predict(elapsed_s, elapsed_s, std::nullopt, measured ? kAll : kNothing);
      Vector6 said = robot.wheels();
      said[kX] += 1.0;
      if (measured)
        filter.measure(kWheelSource, said, kAll);
      filter.move();
      see(filter, robot, usual_lidar(elapsed_s));
      const Innovation found = filter.innovation(kWheelSource, said);
      EXPECT_GT(found.value[kX] * found.value[kX] / found.variance[kX], 16.0)
          << rate_hz << " Hz, measured " << measured;
    }
}

/// Contradiction of wheels that measure a share of the turn of 1 rad/s that the gyro sees begin within a sweep, and a
/// roll rate.
double contradiction_of(double share, double roll_radps) {
  constexpr double kElapsed_s = 0.1, kTurn_radps = 1.0;
  GaussianRobot robot(straight(1.0), {}, 1);
  MotionFilter filter = begun_with(robot, straight(1.0));
  sweep_for(20.0, filter, robot, kElapsed_s, {.lidar = usual_lidar(kElapsed_s)});
  robot.move(kElapsed_s);
  filter.predict(kElapsed_s, kElapsed_s, std::nullopt, kAll);
  Vector6 turn = robot.twist();
  turn[kYaw] += kTurn_radps;
  filter.measure(kGyroSource, turn, kRotation);
  filter.move();
  turn[kYaw] += (share - 1.0) * kTurn_radps;
  turn[kYaw - 2] += roll_radps;
  return filter.contradiction(kWheelSource, turn);
}

TEST(MotionFilter, LateSourceDoesNotContradictATurnThatBegins) {
  EXPECT_LT(contradiction_of(1.0, 0.0), 1.0);
  EXPECT_LT(contradiction_of(0.8, 0.0), 1.5) << "20 ms late";
  EXPECT_GT(contradiction_of(0.0, 0.0), 13.8) << "as unlikely as a fault";
}

TEST(MotionFilter, RollRateIsNoContradiction) { EXPECT_LT(contradiction_of(1.0, 1.0), 1.0); }

} // namespace
} // namespace locus::test
