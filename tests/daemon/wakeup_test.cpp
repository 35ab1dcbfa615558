// SPDX-License-Identifier: Apache-2.0
#include "daemon/wakeup.hpp"

#include <gtest/gtest.h>

#include <chrono>
#include <ctime>
#include <thread>

#include "daemon/machine_time.hpp"

namespace locus::daemon {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

Duration time_of(auto&& work) {
  const Duration begin = read_clock(CLOCK_MONOTONIC);
  work();
  return read_clock(CLOCK_MONOTONIC) - begin;
}

TEST(Wakeup, WaitEndsAtItsTimeout) {
  Wakeup wakeup;
  EXPECT_GE(time_of([&] { wakeup.wait_for(milliseconds{20}); }), milliseconds{20});
}

TEST(Wakeup, NotificationBeforeTheWaitIsUsedOnce) {
  Wakeup wakeup;
  wakeup.notify();
  EXPECT_LT(time_of([&] { wakeup.wait_for(seconds{20}); }), seconds{10});
  EXPECT_GE(time_of([&] { wakeup.wait_for(milliseconds{20}); }), milliseconds{20});
}

TEST(Wakeup, AnotherThreadEndsTheWait) {
  Wakeup wakeup;
  std::thread other([&] {
    std::this_thread::sleep_for(milliseconds{20});
    wakeup.notify();
  });
  EXPECT_LT(time_of([&] { wakeup.wait_for(seconds{20}); }), seconds{10});
  other.join();
}

} // namespace
} // namespace locus::daemon
