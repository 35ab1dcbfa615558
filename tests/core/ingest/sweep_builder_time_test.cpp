// SPDX-License-Identifier: Apache-2.0
// Sweeps while time steps or packets are late.
#include "core/ingest/sweep_builder.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

#include "core/ingest/numbered_lidar.hpp"

namespace locus::test {
namespace {

using std::chrono::hours;
using std::chrono::microseconds;
using std::chrono::milliseconds;
using std::chrono::seconds;

TEST(SweepBuilder, BackwardTimeRestarts) {
  NumberedLidar lidar;
  Built built;
  built.play(lidar, seconds{1});
  const std::size_t before = built.sweeps.size();
  lidar.jump(-hours{1});
  const Stamp jumped_to = lidar.next();
  built.play(lidar, seconds{2});
  EXPECT_EQ(built.builder.counters().restarts, 1U);
  EXPECT_GT(built.builder.counters().late_packets, 0U);
  EXPECT_LT(built.builder.counters().late_packets, 1000U) << "no more than a second and a bit is lost";
  ASSERT_GT(built.sweeps.size(), before + 5);
  EXPECT_GE(built.sweeps.back().start, jumped_to);
  EXPECT_GT(built.sweeps.back().points.size(), 25'000U);
}

/// Packets delayed by a stalled network while other sensors advanced the time.
TEST(SweepBuilder, PacketBurstDoesNotRestart) {
  NumberedLidar lidar;
  Built built;
  built.play(lidar, seconds{1});
  const Stamp released = lidar.next() + milliseconds{950};
  for (Stamp now = lidar.next(); now < released; now += milliseconds{10})
    built.builder.advance(now);
  while (lidar.next() < released)
    built.builder.add(lidar.packet(), released);
  built.play(lidar, seconds{1});
  EXPECT_GT(built.builder.counters().late_packets, 600U);
  EXPECT_EQ(built.builder.counters().restarts, 0U);
  for (std::size_t i = 1; i < built.sweeps.size(); ++i)
    ASSERT_EQ(built.sweeps[i].start, built.sweeps[i - 1].end);
  EXPECT_GT(built.sweeps.back().points.size(), 25'000U);
}

/// A sender that waits for a processor sends what it has saved up in time slices, slowly. This was taken for a clock
/// that was set back: sweeps ended before others that were already given out.
TEST(SweepBuilder, SlowCatchUpDoesNotRestart) {
  NumberedLidar lidar;
  Built built;
  built.play(lidar, seconds{1});
  Stamp arrival = lidar.next() + milliseconds{1400};
  built.builder.advance(arrival);
  for (int i = 0; i < 2000; ++i, arrival += microseconds{1100})
    built.builder.add(lidar.packet(), arrival);
  EXPECT_GT(built.builder.counters().late_packets, 900U);
  EXPECT_EQ(built.builder.counters().restarts, 0U);
  for (std::size_t i = 1; i < built.sweeps.size(); ++i)
    ASSERT_EQ(built.sweeps[i].start, built.sweeps[i - 1].end);
  EXPECT_GT(built.sweeps.back().points.size(), 25'000U);
}

/// The stamps of tf go back only where waiting would take longer than a listener bridges.
TEST(SweepBuilder, OneSecondBackwardStepIsWaitedOut) {
  for (const auto& [set_back, restarts] : {std::pair{milliseconds{1500}, 0U}, std::pair{milliseconds{5000}, 1U}}) {
    NumberedLidar lidar;
    Built built;
    built.play(lidar, seconds{1});
    lidar.jump(-set_back);
    built.play(lidar, seconds{3});
    EXPECT_EQ(built.builder.counters().restarts, restarts);
    int went_back = 0;
    for (std::size_t i = 1; i < built.sweeps.size(); ++i)
      went_back += built.sweeps[i].end <= built.sweeps[i - 1].end ? 1 : 0;
    EXPECT_EQ(went_back, restarts);
    EXPECT_GT(built.sweeps.back().points.size(), 25'000U);
  }
}

TEST(SweepBuilder, ForwardJumpOfAnHourSkipsEmptyWindows) {
  NumberedLidar lidar;
  Built built;
  built.play(lidar, seconds{1});
  lidar.jump(hours{1});
  const Stamp jumped_to = lidar.next();
  built.play(lidar, seconds{1});
  EXPECT_EQ(built.builder.counters().restarts, 1U);
  EXPECT_LT(built.sweeps.size(), 25U);
  EXPECT_GE(built.sweeps.back().start, jumped_to);
}

} // namespace
} // namespace locus::test
