// SPDX-License-Identifier: Apache-2.0
// Health of a source over time.
#include <gtest/gtest.h>

#include <vector>

#include "core/sources/health_monitor.hpp"
#include "core/sources/monitored_wheels.hpp"

namespace locus::test {
namespace {

using std::chrono::hours;
using std::chrono::milliseconds;
using std::chrono::seconds;

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

/// Samples at 200 Hz that arrive twelve at a time are silent for longer than their rate permits, again and again: the
/// source is never used, and nothing said why.
TEST(HealthMonitor, ReportsASourceWhoseSamplesArriveInBursts) {
  HealthMonitor monitor(kWheels);
  const Stamp start = stamp_from_ns(1'700'000'000'000'000'000);
  int losses = 0;
  for (int i = 0; i < 200 * 10; ++i) {
    const Stamp stamp = start + i * milliseconds{5}, arrival = start + (i / 12 * 12 + 11) * milliseconds{5};
    monitor.judge(OdometrySample{
        .stamp = stamp, .arrival = arrival, .T_source_base = {Eigen::Quaterniond::Identity(), {0.005 * i, 0, 0}}});
    losses += monitor.pop_event().has_value() ? 1 : 0;
  }
  EXPECT_FALSE(monitor.healthy());
  EXPECT_EQ(losses, 1) << "said once";
  ASSERT_TRUE(monitor.refusal());
  EXPECT_TRUE(monitor.refusal()->is_worth_reporting());
  EXPECT_EQ(monitor.refusal()->reason, HealthReason::stale);
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

/// Regression: the step back was taken for a period of minus one hour, which no later sample corrected.
TEST_F(WheelsTest, BackwardHostClockStepKeepsTheTimeout) {
  const Duration timeout = monitor_.timeout();
  run(seconds{4}, [](OdometrySample& sample) { sample.arrival -= hours{1}; });
  EXPECT_TRUE(monitor_.healthy());
  EXPECT_EQ(monitor_.timeout(), timeout);
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

} // namespace
} // namespace locus::test
