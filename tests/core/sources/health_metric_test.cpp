// SPDX-License-Identifier: Apache-2.0
// Samples and motions that cost a source its health.
#include <gtest/gtest.h>

#include <cstdint>
#include <limits>
#include <string_view>
#include <vector>

#include "core/sources/health_monitor.hpp"
#include "core/sources/monitored_wheels.hpp"

namespace locus::test {
namespace {

using std::chrono::hours;
using std::chrono::milliseconds;
using std::chrono::seconds;

const MotionSourceOptions kImu{.name = "imu", .kind = SourceKind::imu, .T_base_source = {}};

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

TEST_F(WheelsTest, OneBadSampleIsDropped) {
  OdometrySample bad = next();
  bad.T_source_base.translation.x() = kNan;
  EXPECT_FALSE(monitor_.judge(bad));
  run(seconds{1});
  EXPECT_TRUE(monitor_.healthy());
  EXPECT_TRUE(events_.empty());
  EXPECT_EQ(left_out(HealthReason::nan), 1U);
}

TEST_F(WheelsTest, LongRunOfNonFiniteSamplesIsUnhealthy) {
  begin_fault();
  run(seconds{1}, [](OdometrySample& sample) { sample.T_source_base.rotation.coeffs().setConstant(kNan); });
  expect_lost(HealthReason::nan, kDetected);
  EXPECT_EQ(left_out(HealthReason::nan), 50U);
  EXPECT_EQ(left_out(HealthReason::stale), 0U);
  expect_back_after_probation();
}

TEST_F(WheelsTest, ZeroQuaternionIsRejected) {
  OdometrySample bad = next();
  bad.T_source_base.rotation.coeffs().setZero();
  EXPECT_FALSE(monitor_.judge(bad));
  EXPECT_EQ(left_out(HealthReason::no_rotation), 1U);
}

TEST_F(WheelsTest, AbsurdPositionIsRejectedAsNonFinite) {
  OdometrySample sample = next();
  sample.T_source_base.translation.y() = -1e300;
  EXPECT_FALSE(monitor_.judge(sample));
  EXPECT_EQ(left_out(HealthReason::nan), 1U);
}

TEST_F(WheelsTest, OldAndDuplicateSamplesAreDropped) {
  const OdometrySample before = next();
  OdometrySample after = next();
  EXPECT_TRUE(monitor_.judge(after));
  EXPECT_FALSE(monitor_.judge(before));
  EXPECT_FALSE(monitor_.judge(after));
  EXPECT_EQ(left_out(HealthReason::out_of_order), 2U);
  EXPECT_TRUE(monitor_.healthy());
}

TEST_F(WheelsTest, LateSamplesAreStale) {
  begin_fault();
  be_silent(milliseconds{200});
  run(seconds{1}, [](OdometrySample& sample) { sample.stamp -= milliseconds{200}; });
  expect_lost(HealthReason::stale, kDetected);
  EXPECT_GE(left_out(HealthReason::stale), 50U);
  expect_back_after_probation();
}

TEST_F(WheelsTest, TolerableLatencyIsHealthy) {
  Duration latency{};
  run(seconds{2}, [&](OdometrySample& sample) {
    latency = std::min<Duration>(latency + milliseconds{1}, milliseconds{45});
    sample.arrival += latency;
  });
  EXPECT_TRUE(monitor_.healthy());
  EXPECT_TRUE(events_.empty());
}

TEST_F(WheelsTest, ConstantPoseWhileMovingIsFrozen) {
  begin_fault();
  const double hangs_at_m = x_m_;
  run(seconds{2}, [&](OdometrySample& sample) { sample.T_source_base.translation.x() = hangs_at_m; });
  expect_lost(HealthReason::frozen, kDetected);
  EXPECT_EQ(left_out(HealthReason::frozen), 100U) << "not one of them says that the robot stands";
  expect_back_after_probation();
}

TEST_F(WheelsTest, StandstillIsNotFrozen) {
  brake_and_stand(seconds{5});
  EXPECT_TRUE(monitor_.healthy());
  EXPECT_EQ(left_out(HealthReason::frozen), 0U);
}

TEST_F(WheelsTest, ConstantPoseAgainstLidarMotionIsFrozen) {
  brake_and_stand(seconds{2});
  RegistrationFeedback moving{now_ - milliseconds{200}, now_};
  moving.twist_base.x() = 0.5;
  monitor_.on_feedback(LidarOpinion::none, moving, now_);
  begin_fault();
  brake_and_stand(seconds{1});
  expect_lost(HealthReason::frozen, kDetected);
}

/// Encoders that are dead beside a gyro that is not, in a turn on the spot at first.
TEST_F(WheelsTest, ConstantPositionAgainstLidarMotionIsFrozen) {
  brake_and_stand(seconds{2});
  const double hangs_at_m = x_m_;
  double yaw_rad = 0.0;
  const auto turn = [&](OdometrySample& sample) {
    sample.T_source_base.translation.x() = hangs_at_m;
    sample.T_source_base.rotation = so3_exp({0.0, 0.0, yaw_rad += 0.01});
  };
  run(seconds{2}, turn);
  EXPECT_EQ(left_out(HealthReason::frozen), 0U);
  RegistrationFeedback moving{now_ - milliseconds{200}, now_};
  moving.twist_base.x() = 0.5;
  monitor_.on_feedback(LidarOpinion::none, moving, now_);
  begin_fault();
  run(seconds{1}, turn);
  expect_lost(HealthReason::frozen, kDetected);
  EXPECT_EQ(left_out(HealthReason::frozen), 50U) << "also while lidar says nothing";
}

TEST_F(WheelsTest, ShakenLidarDoesNotMakeThemFrozen) {
  brake_and_stand(seconds{2});
  for (int sweep = 0; sweep < 20; ++sweep) {
    RegistrationFeedback shaken{now_, now_ + milliseconds{100}};
    shaken.twist_base.x() = sweep % 2 == 0 ? 0.5 : -0.5;
    brake_and_stand(milliseconds{100});
    monitor_.on_feedback(LidarOpinion::none, shaken, now_);
  }
  EXPECT_EQ(left_out(HealthReason::frozen), 0U);
}

/// At 5 Hz the feedback on a sweep arrives with the next sweep.
TEST_F(WheelsTest, LateLidarFeedbackDoesNotMakeThemFrozen) {
  brake_and_stand(milliseconds{520});
  RegistrationFeedback before_the_stop{now_ - milliseconds{220}, now_ - milliseconds{20}};
  before_the_stop.twist_base.x() = 0.4;
  brake_and_stand(milliseconds{320});
  monitor_.on_feedback(LidarOpinion::none, before_the_stop, now_);
  brake_and_stand(seconds{1});
  RegistrationFeedback shaken{now_ - milliseconds{200}, now_};
  shaken.twist_base.x() = 0.25;
  monitor_.on_feedback(LidarOpinion::none, shaken, now_);
  brake_and_stand(seconds{1});
  EXPECT_EQ(left_out(HealthReason::frozen), 0U);
}

TEST_F(WheelsTest, JumpIsUnhealthyUntilMotionResumes) {
  begin_fault();
  x_m_ += 2.0;
  run(milliseconds{80});
  expect_lost(HealthReason::jump, kDetected);
  expect_back_after_probation();
  EXPECT_LE(left_out(HealthReason::jump), 4U);
}

TEST_F(WheelsTest, SingleOutlierIsDropped) {
  OdometrySample astray = next();
  astray.T_source_base.translation.y() += 2.0;
  EXPECT_FALSE(monitor_.judge(astray));
  run(seconds{1});
  EXPECT_TRUE(monitor_.healthy());
  EXPECT_EQ(left_out(HealthReason::jump), 1U);
}

TEST_F(WheelsTest, SpeedAboveTheLimitIsUnhealthy) {
  double ahead_m = 0.0, more_mps = 0.0;
  const auto speed_up = [&](double by_mps2) {
    return [&, by_mps2](OdometrySample& sample) { // added to the 1 m/s
      more_mps = std::max(0.0, more_mps + by_mps2 * to_seconds(kPeriod));
      sample.T_source_base.translation.x() += ahead_m += more_mps * to_seconds(kPeriod);
    };
  };
  run(milliseconds{4400}, speed_up(2.0)); // 9.8 m/s
  EXPECT_TRUE(monitor_.healthy());
  begin_fault();
  run(seconds{2}, speed_up(2.0)); // 13.8
  expect_lost(HealthReason::speed, seconds{2});
  run(seconds{4}, speed_up(-2.0)); // 5.8
  EXPECT_TRUE(monitor_.healthy());
}

TEST_F(WheelsTest, ImpossibleTurnIsAJump) {
  OdometrySample turned = next();
  turned.T_source_base.rotation = so3_exp({0, 0, 0.3});
  EXPECT_FALSE(monitor_.judge(turned));
  EXPECT_EQ(left_out(HealthReason::jump), 1U);
}

TEST_F(WheelsTest, RoughMotionIsNoJump) {
  int i = 0;
  run(seconds{5}, [&](OdometrySample& sample) { // alternating pose errors of 15 mm and one degree
    sample.T_source_base.translation.y() += ++i % 2 == 0 ? 0.015 : -0.015;
    sample.T_source_base.rotation = so3_exp({0, 0, i % 2 == 0 ? 0.017 : -0.017});
  });
  EXPECT_TRUE(monitor_.healthy());
  EXPECT_EQ(left_out(HealthReason::jump), 0U);
}

TEST_F(WheelsTest, TenfoldCovarianceIsUnhealthy) {
  begin_fault();
  run(seconds{1}, [](OdometrySample& sample) { sample.covariance_scale = 10.0; });
  expect_lost(HealthReason::covariance, kDetected);
  expect_back_after_probation();
}

/// Wheels whose driver left out the quaternion's w were used wherever its length was above a half.
TEST_F(WheelsTest, UnnormalisedQuaternionsAreRejected) {
  for (const Eigen::Quaterniond& q : {Eigen::Quaterniond{0, 0, 0, 0}, Eigen::Quaterniond{0, 0, 0, 0.3},
                                      Eigen::Quaterniond{0, 0, 0, 0.98}, Eigen::Quaterniond{2, 0, 0, 0}}) {
    const std::uint64_t before = left_out(HealthReason::no_rotation);
    OdometrySample sample = next();
    sample.T_source_base.rotation = q;
    EXPECT_FALSE(monitor_.judge(sample));
    EXPECT_EQ(left_out(HealthReason::no_rotation), before + 1) << q.coeffs().transpose();
  }
}

/// At half a turn a quaternion without w is of unit length, and such wheels were used there.
TEST_F(WheelsTest, QuaternionsWithoutWAreRejectedAtHalfATurn) {
  OdometrySample sample = next();
  sample.T_source_base.rotation = {0, 0, 0, 0.9};
  EXPECT_FALSE(monitor_.judge(sample));
  sample = next();
  sample.T_source_base.rotation = {0, 0, 0, 1};
  EXPECT_FALSE(monitor_.judge(sample));
  EXPECT_EQ(left_out(HealthReason::no_rotation), 2U);
  EXPECT_TRUE(monitor_.judge(next()));
}

TEST_F(WheelsTest, ClockStepOfAnHourIsUnhealthyAndRelearned) {
  begin_fault();
  run(milliseconds{200}, [](OdometrySample& sample) { sample.stamp += hours{1}; });
  expect_lost(HealthReason::out_of_order, kDetected);
  run(seconds{1}, [](OdometrySample& sample) { sample.stamp += hours{1}; });
  EXPECT_TRUE(monitor_.healthy()) << "after probation, on the clock it now has";
  OdometrySample sample = next();
  const Stamp measured = sample.stamp;
  sample.stamp += hours{1};
  EXPECT_EQ(monitor_.judge(sample), measured);
  EXPECT_EQ(monitor_.counters().clock_steps, 1U);
}

TEST_F(WheelsTest, BackwardHostClockStepAtRestIsNotFrozen) {
  brake_and_stand(seconds{3});
  run(seconds{4}, [&](OdometrySample& sample) {
    sample.arrival -= hours{1};
    sample.T_source_base.translation.x() = stopping_at_m_;
  });
  EXPECT_TRUE(monitor_.healthy());
  EXPECT_EQ(left_out(HealthReason::frozen), 0U);
}

/// A gyro at 200 Hz with a little noise.
class ImuTest : public testing::Test {
 protected:
  ImuTest() { run(seconds{1}, 0.5); }

  void run(Duration duration, double turn_rate_radps, double noise_radps = 0.003) {
    run_with_force(duration, turn_rate_radps, noise_radps, {0, 0, 9.81}, milliseconds{5});
  }
  /// Sends samples at 200 Hz, with a noise of `noise_radps` in the force as well, which is sampled every
  /// `force_period`.
  void run_with_force(Duration duration, double turn_rate_radps, double noise_radps, const Eigen::Vector3d& force_mps2,
                      Duration force_period) {
    Stamp force_sampled{};
    Eigen::Vector3d force;
    for (const Stamp end = now_ + duration; now_ < end;) {
      now_ += milliseconds{5};
      noise_radps = -noise_radps;
      if (now_ - force_sampled >= force_period) {
        force = force_mps2 + Eigen::Vector3d{noise_radps, 0, 0};
        force_sampled = now_;
      }
      monitor_.judge(ImuSample{.stamp = now_,
                               .arrival = now_,
                               .angular_velocity_radps = {0, 0, turn_rate_radps + noise_radps},
                               .specific_force_mps2 = force,
                               .attitude = {}});
    }
  }
  HealthMonitor monitor_{kImu};
  Stamp now_ = stamp_from_ns(1'700'000'000'000'000'000);
};

TEST_F(ImuTest, RepeatedReadingIsFrozen) {
  run(milliseconds{60}, 0.5, 0.0);
  const auto event = monitor_.pop_event();
  ASSERT_TRUE(event);
  EXPECT_EQ(event->reason, HealthReason::frozen);
  run(seconds{2}, 0.5);
  EXPECT_TRUE(monitor_.healthy());
}

TEST_F(ImuTest, FrozenInATurnIsNotCalledWrong) {
  RegistrationFeedback otherwise;
  otherwise.observes.fill(true);
  otherwise.twist_base << 1.0, 0, 0, 0, 0, -0.3;
  for (int sweep = 0; sweep < 20; ++sweep) {
    run(milliseconds{100}, 0.5, 0.0);
    otherwise.from = now_ - milliseconds{200};
    otherwise.to = now_ - milliseconds{100};
    monitor_.on_feedback(LidarOpinion::none, otherwise, now_);
  }
  EXPECT_FALSE(monitor_.healthy());
  EXPECT_EQ(monitor_.verdict(), "");
  run(seconds{2}, -0.3);
  EXPECT_TRUE(monitor_.healthy());
}

TEST_F(ImuTest, NoiselessUnitIsNotFrozenAtRest) {
  run(seconds{2}, 0.0, 0.0);
  EXPECT_TRUE(monitor_.healthy());
  EXPECT_EQ(monitor_.counters().rejected_as(HealthReason::frozen), 0U);
}

TEST_F(ImuTest, ZerosAreNoReadingOfAUnitThatMeasuresForces) {
  run_with_force(milliseconds{60}, 0.0, 0.0, Eigen::Vector3d::Zero(), milliseconds{5});
  const auto event = monitor_.pop_event();
  ASSERT_TRUE(event);
  EXPECT_EQ(event->reason, HealthReason::frozen);
  run(seconds{2}, 0.5);
  EXPECT_TRUE(monitor_.healthy());
}

TEST(NewImu, GyroWithoutAccelerometerMayStandStill) {
  HealthMonitor monitor{kImu};
  Stamp now = stamp_from_ns(1'700'000'000'000'000'000);
  for (int sample = 0; sample < 100; ++sample, now += milliseconds{5})
    EXPECT_TRUE(monitor.judge(ImuSample{now, now, Eigen::Vector3d::Zero(), Eigen::Vector3d::Zero(), {}}));
  EXPECT_EQ(monitor.counters().rejected_as(HealthReason::frozen), 0U);
}

/// The gyro is sound, and stays in use.
TEST_F(ImuTest, AccelerometerThatRepeatsOneForceBesideALiveGyroIsNotUsed) {
  EXPECT_TRUE(monitor_.trusts_accelerometer());
  run_with_force(milliseconds{300}, 0.5, 0.003, {0, 0, 9.81}, seconds{10});
  EXPECT_FALSE(monitor_.trusts_accelerometer());
  EXPECT_NE(monitor_.verdict().find("repeats one acceleration"), std::string_view::npos);
  EXPECT_TRUE(monitor_.healthy());
  run(milliseconds{900}, 0.5);
  EXPECT_FALSE(monitor_.trusts_accelerometer()) << "on probation";
  run(milliseconds{200}, 0.5);
  EXPECT_TRUE(monitor_.trusts_accelerometer());
  EXPECT_EQ(monitor_.verdict(), "");
}

/// Cameras with an inertial unit repeat its accelerations, of 63 Hz, for each reading of the gyro.
TEST_F(ImuTest, AccelerometerThatIsSlowerThanTheGyroIsUsed) {
  run_with_force(seconds{3}, 0.5, 0.003, {0, 0, 9.81}, milliseconds{15});
  EXPECT_TRUE(monitor_.trusts_accelerometer());
  EXPECT_EQ(monitor_.verdict(), "");
}

TEST_F(ImuTest, ATurnRateBeyondAnyRangeIsAJump) {
  run(milliseconds{100}, 60.0);
  EXPECT_FALSE(monitor_.healthy());
  EXPECT_EQ(monitor_.counters().rejected_as(HealthReason::jump), 20U);
}

TEST_F(ImuTest, NonFiniteReadingIsDropped) {
  now_ += milliseconds{5};
  EXPECT_FALSE(monitor_.judge(ImuSample{now_, now_, {0, 0, kNan}, {0, 0, 9.81}, {}}));
  EXPECT_FALSE(monitor_.judge(ImuSample{now_, now_, {0, 0, 0.1}, {kNan, 0, 9.81}, {}}));
  EXPECT_EQ(monitor_.counters().rejected_as(HealthReason::nan), 2U);
}

/// Regression: the reading stayed in the accumulated rotation, masked the robot's own, and the unit was rejected for
/// good.
TEST_F(ImuTest, OneAbsurdReadingIsDropped) {
  now_ += milliseconds{5};
  EXPECT_FALSE(monitor_.judge(ImuSample{now_, now_, {0, 0, 1e20}, {0, 0, 9.81}, {}}));
  RegistrationFeedback agreeing;
  agreeing.observes.fill(true);
  agreeing.twist_base[5] = 0.5;
  for (int sweep = 0; sweep < 40; ++sweep) {
    run(milliseconds{100}, 0.5);
    agreeing.from = now_ - milliseconds{200};
    agreeing.to = now_ - milliseconds{100};
    monitor_.on_feedback(LidarOpinion::agrees, agreeing, now_);
  }
  EXPECT_TRUE(monitor_.healthy());
  EXPECT_EQ(monitor_.verdict(), "");
}

} // namespace
} // namespace locus::test
