// SPDX-License-Identifier: Apache-2.0
// What the filter finds out about the motion sources, and says of them.
#include "core/odometry/motion_filter.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <optional>
#include <utility>

#include "core/odometry/gaussian_robot.hpp"

namespace locus::test {
namespace {

// --- What it finds out about the sensors --------------------------------------------------------------------------

/// The turn that lidar sees in so long tells the bias as well as the gyro's own noise lets it.
TEST(MotionFilter, FindsTheBiasOfAGyro) {
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

TEST(MotionFilter, FindsTheScaleOfWheelsWhereLidarSeesAllAxes) {
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

/// As on a robot whose odometry is half a degree askew: what carries it on where lidar is gone is the way it goes.
TEST(MotionFilter, FindsWhereAnOdometryGoesWhenItGoesAhead) {
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

/// Mean over half a minute of the noise that it has learned, in units of the true one. Lidar is better than the source.
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

// The floors are 6 mm, 1 mrad for odometry, 1 mrad for a gyro.
TEST(MotionFilter, LearnsHowBadWheelsAre) { expect_learned(kWheelSource, {.wheels = 10.0 * kUsualWheels}); }
TEST(MotionFilter, LearnsHowGoodWheelsAre) {
  expect_learned(kWheelSource, {.wheels = along_each_axis(0.006, 0.001 / kRadPerDeg)});
}
TEST(MotionFilter, LearnsHowBadAGyroIs) { expect_learned(kGyroSource, {.gyro = 10.0 * kUsualGyro}); }
TEST(MotionFilter, LearnsHowGoodAGyroIs) {
  expect_learned(kGyroSource, {.gyro = along_each_axis(0.0, 0.001 / kRadPerDeg)});
}

/// Two sources of the usual noise, of which nothing else tells how noisy they are: neither is better or worse known
/// than before.
TEST(MotionFilter, LearnsNothingOfASourceThatNothingElseCanJudge) {
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

TEST(MotionFilter, LearnsNothingOfWheelsAlongAnAxisThatLidarDoesNotSee) {
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

TEST(MotionFilter, ForgetsBiasScaleAndNoiseOfASourceThatMayComeBackAsAnother) {
  GaussianRobot robot(
      straight(1.5),
      {.wheels = 5.0 * kUsualWheels, .gyro = 5.0 * kUsualGyro, .scale = 0.04, .bias_radps = {0.01, 0.01, 0.01}}, 1);
  MotionFilter filter = begun_with(robot, straight(1.5));
  sweep_for(30.0, filter, robot, 0.1, {.lidar = usual_lidar(0.1)});
  ASSERT_GT(noise_of(filter, kWheelSource, robot.twist(), 0.1)[kX], 5.0 * kUsualWheels[kX] * kUsualWheels[kX]);
  const Matrix12 before = filter.covariance();
  const Eigen::Vector3d bias = filter.state().segment<3>(filter.state_of(kGyroSource));
  filter.forget(kWheelSource);
  EXPECT_EQ(filter.state().segment<2>(filter.state_of(kWheelSource)), Eigen::Vector2d::Zero());
  EXPECT_EQ(filter.state().segment<3>(filter.state_of(kGyroSource)), bias) << "another one";
  filter.forget(kGyroSource);
  EXPECT_EQ(filter.state().segment<3>(filter.state_of(kGyroSource)), Eigen::Vector3d::Zero());
  EXPECT_EQ(filter.covariance(), before) << "where the robot is is as well known";
  filter.predict(0.1, 0.1, std::nullopt, kNothing);
  filter.move();
  for (const auto& [source, usual, first] :
       {std::tuple(kWheelSource, kUsualWheels, 0), std::tuple(kGyroSource, kUsualGyro, 3)})
    for (int axis = first; axis < 6; ++axis)
      EXPECT_NEAR(noise_of(filter, source, robot.twist(), 0.1)[axis], usual[axis] * usual[axis], 1e-12) << axis;
}

// --- What it says of sources --------------------------------------------------------------------------------------

/// Squared innovation over its variance, mean over the second half of 20 drives of 20 s. What is not measured all the
/// time is in the first half, so that its bias is known.
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
      const Vector6 said = source == kGyroSource ? robot.gyro() : robot.wheels();
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

TEST(MotionFilter, AnHonestSourceIsAsFarOffAsItMayBe) {
  for (const double rate_hz : kRates_hz)
    for (const SourceId source : {kWheelSource, kGyroSource}) {
      const Vector6 mean = mean_ratio(rate_hz, source, true);
      for (int axis = 0; axis < 6; ++axis) {
        EXPECT_GT(mean[axis], 0.7) << rate_hz << " Hz, source " << index_of(source) << ", axis " << axis;
        EXPECT_LT(mean[axis], 1.4) << rate_hz << " Hz, source " << index_of(source) << ", axis " << axis;
      }
    }
}

TEST(MotionFilter, AnHonestSourceThatIsNotUsedIsAsFarOffAsItMayBe) {
  for (const double rate_hz : kRates_hz)
    for (const SourceId source : {kWheelSource, kGyroSource}) {
      const Vector6 mean = mean_ratio(rate_hz, source, false);
      for (int axis = 0; axis < 6; ++axis) {
        EXPECT_GT(mean[axis], 0.7) << rate_hz << " Hz, source " << index_of(source) << ", axis " << axis;
        EXPECT_LT(mean[axis], 1.4) << rate_hz << " Hz, source " << index_of(source) << ", axis " << axis;
      }
    }
}

TEST(MotionFilter, WheelsThatAreOffByAMetreEachSecondAreFoundOut) {
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

} // namespace
} // namespace locus::test
