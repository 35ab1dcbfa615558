// SPDX-License-Identifier: Apache-2.0
#include "daemon/worker.hpp"

#include <atomic>
#include <chrono>
#include <thread>

#include <gtest/gtest.h>

namespace locus::daemon {
namespace {

using std::chrono::milliseconds;

constexpr Duration kLong = std::chrono::hours{1};

/// Whether a condition comes true within seconds.
template <class Condition> bool comes_true(const Condition& condition) {
  const auto deadline = std::chrono::steady_clock::now() + std::chrono::seconds{10};
  while (!condition() && std::chrono::steady_clock::now() < deadline)
    std::this_thread::sleep_for(milliseconds{1});
  return condition();
}

TEST(Worker, DoesARoundAfterEachNotificationThatItSleepsThrough) {
  std::atomic<int> rounds{0};
  Worker worker("test", kLong, [&] { ++rounds; });
  for (int notified = 1; notified <= 3; ++notified) {
    worker.notify();
    EXPECT_TRUE(comes_true([&] { return rounds == notified; })) << rounds;
  }
}

TEST(Worker, DoesARoundEachPeriodThoughNobodyNotifies) {
  std::atomic<int> rounds{0};
  const Worker worker("test", milliseconds{5}, [&] { ++rounds; });
  EXPECT_TRUE(comes_true([&] { return rounds >= 3; })) << rounds;
}

TEST(Worker, BeginsInItsOwnThreadBeforeTheFirstRound) {
  std::atomic<std::thread::id> began;
  std::atomic<bool> began_first{false};
  {
    const Worker worker(
        "test", kLong, [&] { began_first = began.load() == std::this_thread::get_id(); },
        [&] { began = std::this_thread::get_id(); });
  }
  EXPECT_TRUE(began_first);
  EXPECT_NE(began.load(), std::this_thread::get_id());
}

/// What was handed over before it is told to stop is not lost.
TEST(Worker, DoesALastRoundWhenItIsDestroyedWithoutWaitingForThePeriod) {
  std::atomic<int> handed_over{0}, seen{0};
  const auto began = std::chrono::steady_clock::now();
  {
    const Worker worker("test", kLong, [&] { seen = handed_over.load(); });
    handed_over = 7;
  }
  EXPECT_EQ(seen, 7);
  EXPECT_LT(std::chrono::steady_clock::now() - began, std::chrono::seconds{10});
}

} // namespace
} // namespace locus::daemon
