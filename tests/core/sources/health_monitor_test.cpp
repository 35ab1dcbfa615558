// SPDX-License-Identifier: Apache-2.0
#include "core/sources/health_monitor.hpp"

#include <gtest/gtest.h>

#include <cstdint>
#include <limits>
#include <vector>

namespace locus {
namespace {

using std::chrono::hours;
using std::chrono::milliseconds;
using std::chrono::seconds;

const MotionSourceOptions kWheels{.name = "wheels", .kind = SourceKind::odometry, .T_base_source = {}};
const MotionSourceOptions kImu{.name = "imu", .kind = SourceKind::imu, .T_base_source = {}};

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

/// Wheels at 50 Hz that report 1 m/s, and the faults of their samples on the way to the monitor.
class WheelsTest : public testing::Test {
 protected:
  static constexpr Duration kPeriod = milliseconds{20};

  WheelsTest() { run(seconds{2}); }

  [[nodiscard]] OdometrySample next() {
    now_ += kPeriod;
    x_m_ += 1.0 * to_seconds(kPeriod);
    return {.stamp = now_, .arrival = now_, .T_source_base = {Eigen::Quaterniond::Identity(), {x_m_, 0, 0}}};
  }

  /// Feeds samples for this long, each modified by `worse`.
  template <class Worse> void run(Duration duration, const Worse& worse) {
    for (const Stamp end = now_ + duration; now_ < end;) {
      OdometrySample sample = next();
      worse(sample);
      monitor_.judge(sample);
      note();
    }
  }
  void run(Duration duration) {
    run(duration, [](OdometrySample&) {});
  }

  /// Decelerates at 2 m/s^2, then stands.
  void brake_and_stand(Duration duration) {
    run(duration, [&](OdometrySample& sample) {
      x_m_ = sample.T_source_base.translation.x() = stopping_at_m_ += speed_mps_ * to_seconds(kPeriod);
      speed_mps_ = std::max(0.0, speed_mps_ - 2.0 * to_seconds(kPeriod));
    });
  }

  /// Feeds nothing for this long and advances the time every millisecond.
  void be_silent(Duration duration) {
    for (const Stamp end = now_ + duration; now_ < end;) {
      now_ += milliseconds{1};
      x_m_ += 1e-3;
      monitor_.advance(now_);
      note();
    }
  }

  /// Feeds `sweeps` of 100 ms with this opinion of the lidar.
  void hear(LidarOpinion opinion, int sweeps, const RegistrationFeedback& feedback = {}) {
    for (int i = 0; i < sweeps; ++i) {
      run(milliseconds{100});
      monitor_.on_feedback(opinion, feedback, now_);
      note();
    }
  }

  [[nodiscard]] std::uint64_t left_out(HealthReason reason) const { return monitor_.counters().rejected_as(reason); }

  void expect_lost(HealthReason reason, Duration at_most_after) {
    EXPECT_FALSE(monitor_.healthy());
    ASSERT_EQ(events_.size(), 1U);
    EXPECT_FALSE(events_[0].healthy);
    EXPECT_EQ(events_[0].reason, reason);
    EXPECT_LE(events_[0].stamp - fault_began_, at_most_after);
    EXPECT_GE(left_out(reason), 1U);
  }

  void expect_back_after_probation() {
    run(HealthMonitor::kProbation - milliseconds{20});
    EXPECT_FALSE(monitor_.healthy());
    run(milliseconds{100});
    EXPECT_TRUE(monitor_.healthy());
    EXPECT_EQ(events_.size(), 2U);
    EXPECT_EQ(monitor_.counters().health_changes, 2U);
  }

  void begin_fault() { fault_began_ = now_; }

  HealthMonitor monitor_{kWheels};
  Stamp now_ = stamp_from_ns(1'700'000'000'000'000'000);
  double x_m_ = 0.0;
  double stopping_at_m_ = 2.0, speed_mps_ = 1.0; ///< of brake_and_stand
  Stamp fault_began_;
  std::vector<HealthEvent> events_;

 private:
  void note() {
    if (const auto event = monitor_.pop_event())
      events_.push_back(*event);
  }
};

constexpr Duration kDetected = milliseconds{80}; ///< three periods, and the sample before

TEST_F(WheelsTest, AreHealthyFromTheFirstSampleOn) {
  EXPECT_TRUE(monitor_.healthy());
  EXPECT_TRUE(events_.empty());
  EXPECT_EQ(monitor_.counters().received, 100U);
  EXPECT_EQ(monitor_.counters().health_changes, 0U);
  HealthMonitor unheard(kWheels);
  EXPECT_FALSE(unheard.healthy());
  unheard.advance(now_);
  EXPECT_FALSE(unheard.pop_event()) << "who never spoke cannot fall silent";
}

TEST_F(WheelsTest, SilenceOfThreeLearnedPeriodsCostsTheirHealth) {
  EXPECT_NEAR(to_seconds(monitor_.timeout()), 0.06, 1e-6);
  begin_fault();
  be_silent(milliseconds{60});
  EXPECT_TRUE(monitor_.healthy());
  be_silent(milliseconds{440});
  expect_lost(HealthReason::stale, milliseconds{61});
  EXPECT_EQ(left_out(HealthReason::stale), 1U) << "a silence is counted once";
  expect_back_after_probation();
}

TEST_F(WheelsTest, TheTimeoutIsNeverShorterThanFiftyMillisecondsNorLongerThanASecond) {
  for (const auto& [period, timeout] :
       {std::pair{milliseconds{5}, milliseconds{50}}, {milliseconds{900}, seconds{1}}}) {
    HealthMonitor monitor(kWheels);
    EXPECT_EQ(monitor.timeout(), HealthMonitor::kLongestTimeout) << "before anything is learned";
    for (int i = 0; i < 20; ++i) {
      const Stamp stamp = stamp_from_ns(0) + i * period;
      monitor.judge(OdometrySample{.stamp = stamp, .arrival = stamp, .T_source_base = {}});
    }
    EXPECT_EQ(monitor.timeout(), timeout);
  }
}

TEST_F(WheelsTest, PermanentlyLowerRateIsLearned) {
  for (int i = 0; i < 200; ++i) {
    now_ += milliseconds{80};
    x_m_ += 0.08;
    monitor_.judge(OdometrySample{
        .stamp = now_, .arrival = now_, .T_source_base = {Eigen::Quaterniond::Identity(), {x_m_, 0, 0}}});
  }
  EXPECT_TRUE(monitor_.healthy());
  EXPECT_GT(monitor_.timeout(), milliseconds{200});
}

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

/// A source that was refused from its first sample on was refused in silence.
TEST(HealthMonitor, ReportsASourceThatWasNeverGoodAfterFiveSeconds) {
  HealthMonitor monitor(kWheels);
  Stamp now = stamp_from_ns(1'700'000'000'000'000'000);
  const auto send_for = [&](Duration duration, const Eigen::Quaterniond& rotation) {
    std::vector<HealthEvent> events;
    for (const Stamp end = now + duration; now < end;) {
      now += milliseconds{20};
      monitor.judge(OdometrySample{.stamp = now, .arrival = now, .T_source_base = {rotation, {0, 0, 0}}});
      if (const auto event = monitor.pop_event())
        events.push_back(*event);
    }
    return events;
  };
  EXPECT_TRUE(send_for(milliseconds{4900}, Eigen::Quaterniond{0, 0, 0, 0}).empty());
  EXPECT_FALSE(monitor.refusal()->is_worth_reporting());
  const std::vector<HealthEvent> events = send_for(seconds{60}, Eigen::Quaterniond{0, 0, 0, 0});
  ASSERT_EQ(events.size(), 1U) << "said once";
  EXPECT_FALSE(events[0].healthy);
  EXPECT_EQ(events[0].reason, HealthReason::no_rotation);
  EXPECT_TRUE(monitor.refusal()->is_worth_reporting());
  EXPECT_EQ(monitor.refusal()->reason, HealthReason::no_rotation);
  send_for(seconds{2}, Eigen::Quaterniond::Identity());
  EXPECT_TRUE(monitor.healthy());
  EXPECT_FALSE(monitor.refusal());
  EXPECT_GT(monitor.longest_refusal().lasted, seconds{64});
}

TEST_F(WheelsTest, RefusalLastsUntilTheyAreHealthy) {
  EXPECT_FALSE(monitor_.refusal());
  int i = 0;
  run(seconds{6}, [&](OdometrySample& sample) { // one sample in two seconds is good
    sample.covariance_scale = ++i % 100 == 0 ? 1.0 : 10.0;
  });
  ASSERT_TRUE(monitor_.refusal());
  EXPECT_TRUE(monitor_.refusal()->is_worth_reporting());
  EXPECT_EQ(monitor_.refusal()->reason, HealthReason::covariance);
  run(seconds{2});
  EXPECT_TRUE(monitor_.healthy());
  EXPECT_FALSE(monitor_.refusal());
}

TEST_F(WheelsTest, TheirPeriodIsKnownAfterFiftySamples) {
  ASSERT_TRUE(monitor_.period());
  EXPECT_NEAR(to_seconds(*monitor_.period()), 0.02, 1e-3);
  EXPECT_FALSE(HealthMonitor(kWheels).period());
}

TEST(HealthReason, EachIsExplained) {
  for (std::size_t i = 0; i < kHealthReasonCount; ++i)
    EXPECT_FALSE(explanation(static_cast<HealthReason>(i)).empty()) << i;
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

/// Regression: the step back was taken for a period of minus one hour, which no later sample corrected.
TEST_F(WheelsTest, BackwardHostClockStepKeepsTheTimeout) {
  const Duration timeout = monitor_.timeout();
  run(seconds{4}, [](OdometrySample& sample) { sample.arrival -= hours{1}; });
  EXPECT_TRUE(monitor_.healthy());
  EXPECT_EQ(monitor_.timeout(), timeout);
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

TEST_F(WheelsTest, ThreeContradictingSweepsAreUnhealthy) {
  begin_fault();
  hear(LidarOpinion::disagrees, 2);
  hear(LidarOpinion::agrees, 1);
  hear(LidarOpinion::disagrees, 2);
  hear(LidarOpinion::none, 3);
  EXPECT_TRUE(monitor_.healthy()) << "never three in a row";
  hear(LidarOpinion::disagrees, 1);
  expect_lost(HealthReason::disagreement, seconds{2});
  hear(LidarOpinion::disagrees, 20);
  EXPECT_FALSE(monitor_.healthy()) << "the probation does not end in disagreement";
  hear(LidarOpinion::agrees, 12);
  EXPECT_TRUE(monitor_.healthy());
  EXPECT_EQ(events_.size(), 2U);
}

TEST_F(WheelsTest, ExternalVerdictHoldsUntilItIsWithdrawn) {
  begin_fault();
  monitor_.set_outside_verdict(false, now_);
  run(seconds{3});
  expect_lost(HealthReason::outside, Duration::zero());
  EXPECT_EQ(left_out(HealthReason::outside), 150U);
  monitor_.set_outside_verdict(true, now_);
  expect_back_after_probation();
}

TEST_F(WheelsTest, FlappingSourceChangesHealthOnce) {
  for (int i = 0; i < 20; ++i) {
    be_silent(milliseconds{150});
    run(milliseconds{500});
  }
  EXPECT_FALSE(monitor_.healthy());
  EXPECT_EQ(events_.size(), 1U);
  be_silent(milliseconds{150});
  expect_back_after_probation();
}

TEST_F(WheelsTest, EpochEndsWithEachLoss) {
  const std::uint32_t epoch = monitor_.epoch();
  be_silent(milliseconds{200});
  EXPECT_NE(monitor_.epoch(), epoch);
  const std::uint32_t next_epoch = monitor_.epoch();
  run(seconds{2});
  EXPECT_EQ(monitor_.epoch(), next_epoch) << "probation and health are one epoch";
}

/// A gyro at 200 Hz with a little noise.
class ImuTest : public testing::Test {
 protected:
  ImuTest() { run(seconds{1}, 0.5); }

  void run(Duration duration, double turn_rate_radps, double noise_radps = 0.003) {
    for (const Stamp end = now_ + duration; now_ < end;) {
      now_ += milliseconds{5};
      noise_radps = -noise_radps;
      monitor_.judge(ImuSample{.stamp = now_,
                               .arrival = now_,
                               .angular_velocity_radps = {0, 0, turn_rate_radps + noise_radps},
                               .specific_force_mps2 = {0, 0, 9.81},
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
} // namespace locus
