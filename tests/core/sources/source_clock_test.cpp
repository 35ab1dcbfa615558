// SPDX-License-Identifier: Apache-2.0
#include "core/sources/source_clock.hpp"

#include <gtest/gtest.h>

namespace locus {
namespace {

using std::chrono::hours;
using std::chrono::milliseconds;
using std::chrono::seconds;

constexpr Stamp today_ms(int ms) { return stamp_from_ns(1'700'000'000'000'000'000) + milliseconds{ms}; }

/// A sample every 20 ms with 3 ms of latency, from a source whose clock is `ahead` of the host's.
std::optional<Stamp> sample(SourceClock& clock, int index, Duration ahead) {
  const Stamp measured = today_ms(20 * index);
  return clock.on_host_clock(measured + ahead, measured + milliseconds{3});
}

TEST(SourceClock, StampsWithinASecondOfArrivalAreAccepted) {
  SourceClock clock;
  EXPECT_EQ(clock.on_host_clock(today_ms(0), today_ms(0)), today_ms(0));
  EXPECT_EQ(clock.on_host_clock(today_ms(20), today_ms(220)), today_ms(20));
  EXPECT_EQ(clock.on_host_clock(today_ms(225), today_ms(220)), today_ms(225)) << "rounded up";
  EXPECT_EQ(clock.offset(), Duration::zero());
}

TEST(SourceClock, StepIsLearnedFromFiveSamplesAndRemoved) {
  for (const Duration step :
       {Duration{hours{1}}, Duration{-hours{1}}, Duration{milliseconds{500}}, Duration{-seconds{5}}}) {
    SourceClock clock;
    int i = 0;
    for (; i < 100; ++i)
      ASSERT_EQ(sample(clock, i, {}), today_ms(20 * i));
    for (int held_back = 1; held_back < SourceClock::kSamplesToLearn; ++held_back)
      EXPECT_FALSE(sample(clock, i++, step));
    EXPECT_EQ(sample(clock, i, step), today_ms(20 * i)) << "the usual latency is not taken for a part of the step";
    EXPECT_EQ(clock.steps(), 1U);
    EXPECT_EQ(clock.offset(), step);
  }
}

/// 100 ppm over ten hours are 3.6 s.
TEST(SourceClock, DriftIsFollowed) {
  for (const double rate : {100e-6, -100e-6, 20e-6, -20e-6}) {
    for (const Duration ahead : {Duration{}, Duration{hours{3}}}) {
      SourceClock clock;
      std::size_t held_back = 0;
      for (int i = 0; i < 10 * 3600; ++i) {
        const Stamp measured = today_ms(0) + milliseconds{1000} * i;
        const Duration way = milliseconds{3 + i * 7 % 11};
        const auto stamp = clock.on_host_clock(measured + ahead + from_seconds(rate * i), measured + way);
        held_back += stamp ? 0U : 1U;
        if (stamp) {
          ASSERT_LT(std::chrono::abs(*stamp - measured), milliseconds{25}) << rate << " after " << i << " s";
        }
      }
      EXPECT_LT(held_back, 5U) << rate;
      EXPECT_EQ(clock.steps(), 0U) << rate;
    }
  }
}

/// A sudden increase of the latency is a delay, not a clock step.
TEST(SourceClock, DelayIsNotFollowed) {
  SourceClock clock;
  for (int i = 0; i < 600; ++i) {
    const Stamp measured = today_ms(0) + seconds{1} * i;
    const auto stamp = clock.on_host_clock(measured, measured + milliseconds{i < 200 ? 3 : 203});
    ASSERT_EQ(stamp, measured) << i;
  }
}

TEST(SourceClock, CorrectedClockIsRelearned) {
  SourceClock clock;
  int i = 0;
  for (; i < 10; ++i)
    sample(clock, i, {});
  for (; i < 20; ++i)
    sample(clock, i, hours{1});
  for (; i < 30; ++i)
    sample(clock, i, {});
  EXPECT_EQ(sample(clock, i, {}), today_ms(20 * i));
  EXPECT_EQ(clock.steps(), 2U);
}

/// Latencies of another publisher, from before a clock step, do not apply to the current samples.
TEST(SourceClock, ReturnToTheHostClockRemovesTheOffset) {
  SourceClock clock;
  int i = 0;
  for (; i < 10; ++i)
    EXPECT_EQ(clock.on_host_clock(today_ms(20 * i), today_ms(20 * i + 300)), today_ms(20 * i));
  for (; i < 20; ++i)
    sample(clock, i, -hours{5});
  for (; i < 30; ++i)
    sample(clock, i, {});
  EXPECT_EQ(sample(clock, i, {}), today_ms(20 * i));
  EXPECT_EQ(clock.offset(), Duration::zero());
}

TEST(SourceClock, ForeignClockIsNoStep) {
  SourceClock clock;
  int i = 0;
  for (; i < SourceClock::kSamplesToLearn; ++i)
    sample(clock, i, -hours{5});
  const auto stamp = sample(clock, i, -hours{5});
  ASSERT_TRUE(stamp);
  EXPECT_EQ(*stamp, today_ms(20 * i + 3)) << "what its latency is nobody can know";
  EXPECT_EQ(clock.steps(), 0U);
}

TEST(SourceClock, InconsistentStampsTeachNothing) {
  SourceClock clock;
  int i = 0;
  for (; i < 10; ++i)
    sample(clock, i, {});
  for (; i < 60; ++i)
    EXPECT_FALSE(sample(clock, i, hours{i}));
  EXPECT_EQ(sample(clock, i, {}), today_ms(20 * i));
  EXPECT_EQ(clock.steps(), 0U);
}

} // namespace
} // namespace locus
