// SPDX-License-Identifier: Apache-2.0
#include "daemon/threads.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <cstdint>
#include <ctime>
#include <thread>

#include "daemon/machine_time.hpp"
#include "support/patience.hpp"

namespace locus::daemon {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

TEST(SpscRing, PopsInOrderUntilEmpty) {
  SpscRing<int, 4> ring;
  EXPECT_TRUE(ring.empty());
  EXPECT_EQ(ring.pop(), std::nullopt);
  EXPECT_TRUE(ring.push(1));
  EXPECT_TRUE(ring.push(2));
  EXPECT_FALSE(ring.empty());
  EXPECT_EQ(ring.pop(), 1);
  EXPECT_EQ(ring.pop(), 2);
  EXPECT_EQ(ring.pop(), std::nullopt);
}

TEST(SpscRing, FullRingRejectsPushAndPreservesItsValues) {
  SpscRing<int, 4> ring;
  for (int round = 0; round < 3; ++round) { // the slots wrap around
    for (int value = 0; value < 4; ++value)
      EXPECT_TRUE(ring.push(value));
    EXPECT_FALSE(ring.push(99));
    for (int value = 0; value < 4; ++value)
      EXPECT_EQ(ring.pop(), value);
    EXPECT_TRUE(ring.push(5));
    EXPECT_EQ(ring.pop(), 5);
  }
}

TEST(SpscRing, ValuesCrossThreadsOnceWholeAndInOrder) {
  constexpr std::uint64_t kValues = 300'000;
  using Value = std::array<std::uint64_t, 4>;
  SpscRing<Value, 16> ring;
  std::thread producer([&] {
    for (std::uint64_t value = 0; value < kValues; ++value) {
      while (!ring.push(Value{value, value, value, value}))
        std::this_thread::yield();
    }
  });
  std::uint64_t wrong = 0;
  for (std::uint64_t expected = 0; expected < kValues;) {
    const std::optional<Value> value = ring.pop();
    if (!value) {
      std::this_thread::yield();
      continue;
    }
    wrong += *value == Value{expected, expected, expected, expected} ? 0U : 1U;
    ++expected;
  }
  producer.join();
  EXPECT_EQ(wrong, 0U);
  EXPECT_TRUE(ring.empty());
}

TEST(LatestSlot, IsEmptyBeforeTheFirstValueAndAfterEachPoll) {
  LatestSlot<int> slot;
  EXPECT_EQ(slot.poll(), nullptr);
  slot.back() = 7;
  EXPECT_FALSE(slot.publish());
  const int* taken = slot.poll();
  ASSERT_NE(taken, nullptr);
  EXPECT_EQ(*taken, 7);
  EXPECT_EQ(slot.poll(), nullptr);
}

TEST(LatestSlot, PollReturnsTheNewestAndPublishReportsDrops) {
  LatestSlot<int> slot;
  slot.back() = 1;
  EXPECT_FALSE(slot.publish());
  slot.back() = 2;
  EXPECT_TRUE(slot.publish());
  slot.back() = 3;
  EXPECT_TRUE(slot.publish());
  const int* taken = slot.poll();
  ASSERT_NE(taken, nullptr);
  EXPECT_EQ(*taken, 3);
  slot.back() = 4;
  EXPECT_FALSE(slot.publish()) << "3 was taken, nothing was dropped";
}

TEST(LatestSlot, PolledValueIsUnchangedByLaterPublications) {
  LatestSlot<int> slot;
  slot.back() = 1;
  ASSERT_FALSE(slot.publish());
  const int* taken = slot.poll();
  ASSERT_NE(taken, nullptr);
  for (int value = 2; value < 10; ++value) {
    slot.back() = value;
    EXPECT_EQ(slot.publish(), value > 2);
    EXPECT_EQ(*taken, 1);
  }
}

/// A torn value would contain words of two values.
TEST(LatestSlot, ValuesCrossThreadsWholeAndInOrderAndEachIsPolledOrDropped) {
  constexpr std::uint64_t kValues = 300'000;
  LatestSlot<std::array<std::uint64_t, 32>> slot;
  std::uint64_t dropped = 0;
  std::thread producer([&] {
    for (std::uint64_t value = 1; value <= kValues; ++value) {
      slot.back().fill(value);
      if (slot.publish())
        ++dropped;
    }
  });
  std::uint64_t taken = 0;
  std::uint64_t torn = 0;
  std::uint64_t out_of_order = 0;
  for (std::uint64_t newest = 0; newest < kValues;) {
    const auto* value = slot.poll();
    if (value == nullptr)
      continue;
    ++taken;
    torn += std::count(value->begin(), value->end(), value->front()) == 32 ? 0U : 1U;
    out_of_order += value->front() > newest ? 0U : 1U;
    newest = value->front();
  }
  producer.join();
  EXPECT_EQ(torn, 0U);
  EXPECT_EQ(out_of_order, 0U);
  EXPECT_EQ(taken + dropped, kValues);
}

Duration time_of(auto&& work) {
  const Duration begin = read_clock(CLOCK_MONOTONIC);
  work();
  return read_clock(CLOCK_MONOTONIC) - begin;
}

TEST(Wakeup, WaitEndsAtItsTimeout) {
  Wakeup wakeup;
  EXPECT_GE(time_of([&] { wakeup.wait_for(milliseconds{20}); }), milliseconds{20});
}

TEST(Wakeup, NotificationBeforeTheWaitEndsOneWait) {
  Wakeup wakeup;
  wakeup.notify();
  EXPECT_LT(time_of([&] { wakeup.wait_for(test::patience()); }), test::patience());
  EXPECT_GE(time_of([&] { wakeup.wait_for(milliseconds{20}); }), milliseconds{20});
}

/// A thousand notifications while the consumer is busy cause one wake-up, not a thousand.
TEST(Wakeup, CoalescedNotificationsEndOneWait) {
  Wakeup wakeup;
  for (int i = 0; i < 1000; ++i)
    wakeup.notify();
  EXPECT_LT(time_of([&] { wakeup.wait_for(test::patience()); }), test::patience());
  EXPECT_GE(time_of([&] { wakeup.wait_for(milliseconds{20}); }), milliseconds{20});
}

TEST(Wakeup, NotificationFromAnotherThreadEndsTheWait) {
  Wakeup wakeup;
  std::thread other([&] {
    std::this_thread::sleep_for(milliseconds{20});
    wakeup.notify();
  });
  EXPECT_LT(time_of([&] { wakeup.wait_for(test::patience()); }), test::patience());
  other.join();
}

constexpr Duration kLong = std::chrono::hours{1};

/// Waits a few seconds for a condition; returns whether it holds.
template <class Condition> bool comes_true(const Condition& condition) {
  const auto deadline = std::chrono::steady_clock::now() + test::patience();
  while (!condition() && std::chrono::steady_clock::now() < deadline)
    std::this_thread::sleep_for(milliseconds{1});
  return condition();
}

TEST(Worker, RunsARoundAfterEachNotification) {
  std::atomic<int> rounds{0};
  Worker worker("test", kLong, [&](bool /*last*/) { ++rounds; });
  for (int notified = 1; notified <= 3; ++notified) {
    worker.notify();
    EXPECT_TRUE(comes_true([&] { return rounds == notified; })) << rounds;
  }
}

TEST(Worker, RunsARoundEachPeriodWithoutNotification) {
  std::atomic<int> rounds{0};
  const Worker worker("test", milliseconds{5}, [&](bool /*last*/) { ++rounds; });
  EXPECT_TRUE(comes_true([&] { return rounds >= 3; })) << rounds;
}

TEST(Worker, CallsBeginInItsThreadBeforeTheFirstRound) {
  std::atomic<std::thread::id> began;
  std::atomic<bool> began_first{false};
  {
    const Worker worker(
        "test", kLong, [&](bool /*last*/) { began_first = began.load() == std::this_thread::get_id(); },
        [&] { began = std::this_thread::get_id(); });
  }
  EXPECT_TRUE(began_first);
  EXPECT_NE(began.load(), std::this_thread::get_id());
}

/// Items handed over before the stop are processed.
TEST(Worker, DestructorRunsALastRoundAtOnce) {
  std::atomic<int> handed_over{0}, seen{0};
  std::atomic<bool> is_told{false};
  const auto began = std::chrono::steady_clock::now();
  {
    const Worker worker("test", kLong, [&](bool last) {
      seen = handed_over.load();
      is_told = last;
    });
    handed_over = 7;
  }
  EXPECT_EQ(seen, 7);
  EXPECT_TRUE(is_told);
  EXPECT_LT(std::chrono::steady_clock::now() - began, test::patience());
}

} // namespace
} // namespace locus::daemon
