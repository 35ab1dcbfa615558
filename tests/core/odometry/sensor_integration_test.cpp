// SPDX-License-Identifier: Apache-2.0
#include "core/odometry/sensor_integration.hpp"

#include <gtest/gtest.h>

#include "core/stamps.hpp"

namespace locus {
namespace {

constexpr SourceId kGyro{0}, kWheelOdometry{1};
constexpr Duration kPerSweep = std::chrono::milliseconds{100};

const MotionSourceOptions kGyroOptions{.name = "imu", .kind = SourceKind::imu, .T_base_source = {}};
const MotionSourceOptions kWheelOdometryOptions{.name = "wheels", .kind = SourceKind::odometry, .T_base_source = {}};

Vector6 twist(double forward_mps, double yaw_radps) {
  return (Vector6{} << forward_mps, 0, 0, 0, 0, yaw_radps).finished();
}
Pose motion(double forward_mps, double yaw_radps) {
  return se3_exp(to_seconds(kPerSweep) * twist(forward_mps, yaw_radps));
}
double yaw_radps(const MotionPrior& prior) { return so3_log(prior.T_last_now.rotation).z() / to_seconds(kPerSweep); }

/// What a lidar that sees all axes well found.
SeenMotion seen(const Pose& T_last_now) {
  return {.T_last_now = T_last_now, .information = 1e8 * Matrix6::Identity(), .stands = false};
}

/// Sources that report what they are told to, from sweep to sweep.
class Sources {
 public:
  Sources() { sweep_.end = at_ms(0); }

  Sweep next(const Pose& imu, const Pose& wheels) {
    sweep_.start = sweep_.end;
    sweep_.end += kPerSweep;
    add(kGyro, imu);
    add(kWheelOdometry, wheels);
    return sweep_;
  }

 private:
  void add(SourceId source, const Pose& T_last_now) {
    SourcePose& at = sweep_.motion.sources[index_of(source)];
    at.known = at.usable = true;
    at.T_source_base = at.T_source_base * T_last_now;
  }

  Sweep sweep_;
};

class SensorIntegrationTest : public testing::Test {
 protected:
  /// After a first sweep.
  explicit SensorIntegrationTest(const OdometryOptions& options = {})
      : sensors(options, {kGyroOptions, kWheelOdometryOptions}) {
    sensors.remember(sources.next({}, {}));
  }

  SensorIntegration sensors;
  Sources sources;
};

TEST_F(SensorIntegrationTest, TheGyroTurnsAndTheWheelsMove) {
  const MotionPrior prior = sensors.integrate(sources.next(motion(0, 0.5), motion(1, 0.3)), std::nullopt);
  EXPECT_NEAR(yaw_radps(prior), 0.5, 1e-9);
  EXPECT_NEAR(prior.T_last_now.translation.x(), 0.1, 1e-3);
  EXPECT_EQ(prior.source.rotation, kGyro);
  EXPECT_EQ(prior.source.translation, kWheelOdometry);
  EXPECT_FALSE(prior.blind);
}

TEST_F(SensorIntegrationTest, WithoutTheGyroTheWheelsDoBoth) {
  const MotionPrior prior = sensors.integrate(sources.next(motion(0, 0.5), motion(1, 0.3)), std::nullopt, kGyro);
  EXPECT_NEAR(yaw_radps(prior), 0.3, 1e-9);
  EXPECT_EQ(prior.source.rotation, kWheelOdometry);
}

TEST_F(SensorIntegrationTest, WhatNobodySaysGoesOnAsBefore) {
  Sweep sweep = sources.next(motion(0, 0.5), motion(1, 0.3));
  sweep.motion.sources[index_of(kWheelOdometry)].usable = false;
  const MotionPrior prior = sensors.integrate(sweep, twist(2, 0));
  EXPECT_NEAR(prior.T_last_now.translation.x(), 0.2, 1e-9);
  EXPECT_NEAR(yaw_radps(prior), 0.5, 1e-9);
  EXPECT_FALSE(prior.source.translation);
  EXPECT_EQ(prior.source.otherwise, NoSourcePrior::constant_velocity);
  EXPECT_FALSE(prior.blind);
  EXPECT_TRUE(sensors.integrate(sweep, std::nullopt).blind) << "not even a velocity is known";
}

TEST_F(SensorIntegrationTest, ASourceThatCameBackIsNotComparedWithWhatItWasBefore) {
  Sweep sweep = sources.next(motion(0, 0.5), motion(1, 0.3));
  ++sweep.motion.sources[index_of(kGyro)].epoch;
  EXPECT_EQ(sensors.integrate(sweep, std::nullopt).source.rotation, kWheelOdometry);
}

TEST(SensorIntegration, AQueueTakesAllFromTheFirst) {
  OdometryOptions options;
  options.fusion = Fusion::queue;
  SensorIntegration sensors(options, {kWheelOdometryOptions, kGyroOptions});
  Sources sources;
  sensors.remember(sources.next({}, {}));
  const MotionPrior prior = sensors.integrate(sources.next(motion(1, 0.3), motion(0, 0.5)), std::nullopt);
  EXPECT_EQ(prior.source.rotation, SourceId{0});
  EXPECT_EQ(prior.source.translation, SourceId{0});
  EXPECT_NEAR(yaw_radps(prior), 0.3, 1e-9);
}

TEST_F(SensorIntegrationTest, LidarContradictsWhoIsFarOff) {
  const Sweep sweep = sources.next(motion(0, 0.3), motion(5, 0.3));
  const auto opinions = sensors.judge(sweep, sensors.integrate(sweep, std::nullopt), seen(motion(1, 0.3)), {});
  EXPECT_EQ(opinions[index_of(kGyro)], LidarOpinion::agrees);
  EXPECT_EQ(opinions[index_of(kWheelOdometry)], LidarOpinion::disagrees);
  EXPECT_EQ(opinions[2], LidarOpinion::none) << "there is no third";
}

TEST_F(SensorIntegrationTest, ASourceIsTheSurerTheBetterItWas) {
  double before = 1.0;
  for (int i = 0; i < 50; ++i) {
    const Sweep sweep = sources.next(motion(0, 0.01), motion(1, 0.01));
    const MotionPrior prior = sensors.integrate(sweep, std::nullopt);
    if (i == 0)
      before = prior.variance[0];
    sensors.judge(sweep, prior, seen(motion(1, 0.01)), {});
    sensors.remember(sweep);
  }
  const MotionPrior after = sensors.integrate(sources.next(motion(0, 0.01), motion(1, 0.01)), std::nullopt);
  EXPECT_LT(after.variance[0], 0.1 * before);
}

TEST_F(SensorIntegrationTest, LidarTeachesAGyroWhatItReadsAtRest) {
  for (int i = 0; i < 200; ++i) {
    const Sweep sweep = sources.next(motion(0, 0.01), motion(1, 0.0));
    sensors.judge(sweep, sensors.integrate(sweep, std::nullopt), seen(motion(1, 0.0)), {});
    sensors.remember(sweep);
  }
  EXPECT_NEAR(yaw_radps(sensors.integrate(sources.next(motion(0, 0.01), motion(1, 0.0)), std::nullopt)), 0.0, 1e-3);
}

TEST_F(SensorIntegrationTest, WhereThereIsNoLidarWheelsTeachIt) {
  for (int i = 0; i < 200; ++i) {
    const Sweep sweep = sources.next(motion(0, 0.01), motion(1, 0.0));
    sensors.judge_blind(sweep);
    sensors.remember(sweep);
  }
  EXPECT_NEAR(yaw_radps(sensors.integrate(sources.next(motion(0, 0.01), motion(1, 0.0)), std::nullopt)), 0.0, 1e-3);
}

TEST_F(SensorIntegrationTest, WhatLidarTaughtNoWheelUnteaches) {
  for (int i = 0; i < 400; ++i) {
    const Sweep sweep = sources.next(motion(0, 0.01), motion(1, i < 200 ? 0.0 : 0.02));
    if (i < 200)
      sensors.judge(sweep, sensors.integrate(sweep, std::nullopt), seen(motion(1, 0.0)), {});
    else
      sensors.judge_blind(sweep);
    sensors.remember(sweep);
  }
  EXPECT_NEAR(yaw_radps(sensors.integrate(sources.next(motion(0, 0.01), motion(1, 0.0)), std::nullopt)), 0.0, 1e-3);
}

TEST_F(SensorIntegrationTest, MotionIsWhatAnySourceSaysIsMore) {
  const auto saw_motion = [this](const Pose& imu, const Pose& wheels) {
    const Sweep sweep = sources.next(imu, wheels);
    const bool saw = sensors.saw_motion(sweep);
    sensors.remember(sweep);
    return saw;
  };
  EXPECT_FALSE(saw_motion(motion(0, 0.01), motion(0.02, 0.0)));
  EXPECT_TRUE(saw_motion(motion(0, 0.03), motion(0, 0)));
  EXPECT_TRUE(saw_motion({}, motion(0.04, 0)));
}

} // namespace
} // namespace locus
