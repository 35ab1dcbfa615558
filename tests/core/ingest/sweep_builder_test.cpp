// SPDX-License-Identifier: Apache-2.0
// Windows of the sweeps, and the returns in them.
#include "core/ingest/sweep_builder.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <tuple>
#include <utility>
#include <vector>

#include "core/ingest/numbered_lidar.hpp"

namespace locus::test {
namespace {

using std::chrono::milliseconds;
using std::chrono::nanoseconds;
using std::chrono::seconds;

/// Expects every return exactly once, in the window in which it was fired and with its age at the window's end, and
/// windows without gaps. A packet that arrives after another lidar's packet has closed the window goes into the next
/// one, at most `late` after the window's end.
void expect_each_return_in_its_sweep(const std::vector<Sweep>& sweeps, const std::vector<const NumberedLidar*>& lidars,
                                     Duration late = {}) {
  std::map<std::pair<std::size_t, std::size_t>, int> times_seen; // by lidar and number
  for (std::size_t s = 0; s < sweeps.size(); ++s) {
    const Sweep& sweep = sweeps[s];
    ASSERT_EQ(sweep.sequence, s);
    ASSERT_EQ(sweep.start, s == 0 ? sweep.start : sweeps[s - 1].end);
    ASSERT_EQ(sweep.raw_returns, sweep.points.size());
    for (const SweepPoint& point : sweep.points) {
      const std::size_t lidar = point.scan_line / 256U;
      const Stamp fired = lidars[lidar]->fired(number_of(point));
      ASSERT_GE(fired, sweep.start - late);
      ASSERT_LT(fired, sweep.end);
      ASSERT_NEAR(point.age_s, to_seconds(sweep.end - fired), 1e-6);
      ++times_seen[{lidar, number_of(point)}];
    }
  }
  for (std::size_t lidar = 0; lidar < lidars.size(); ++lidar) {
    for (std::size_t number = 0; number < lidars[lidar]->count(); ++number) {
      const Stamp fired = lidars[lidar]->fired(number);
      if (fired < sweeps.back().end - late) {
        ASSERT_EQ((times_seen[{lidar, number}]), 1);
      } else {
        ASSERT_LE((times_seen[{lidar, number}]), fired < sweeps.back().end ? 1 : 0);
      }
    }
  }
}

class SweepsAtAnySpeed : public testing::TestWithParam<std::tuple<double, double>> {};

TEST_P(SweepsAtAnySpeed, EachReturnIsInExactlyOneSweepOfOneRevolution) {
  const auto& [rpm, first_azimuth_deg] = GetParam();
  NumberedLidar lidar(0, rpm, first_azimuth_deg);
  Built built;
  built.play(lidar, seconds{2});
  built.builder.finish();
  const double revolution_s = 60.0 / rpm;
  ASSERT_GE(built.sweeps.size(), static_cast<std::size_t>(2.0 / revolution_s) - 1);
  expect_each_return_in_its_sweep(built.sweeps, {&lidar});
  for (std::size_t i = 0; i + 1 < built.sweeps.size(); ++i) // the last may be partial
    EXPECT_NEAR(to_seconds(built.sweeps[i].end - built.sweeps[i].start), revolution_s, 5e-4 * revolution_s);
}

INSTANTIATE_TEST_SUITE_P(Speeds, SweepsAtAnySpeed,
                         testing::Combine(testing::Values(300.0, 593.0, 600.0, 707.0, 1200.0),
                                          testing::Values(0.0, 123.4, 359.9)));

TEST(SweepBuilder, SweepsAreCutBetweenFirings) {
  SweepOptions options = keep_all();
  options.sweep_period = milliseconds{100};
  NumberedLidar lidar;
  Built built(options);
  built.play(lidar, seconds{1});
  ASSERT_GE(built.sweeps.size(), 9U);
  const Sweep& sweep = built.sweeps[4];
  ASSERT_NE((sweep.end - kStart) % kPacket, Duration::zero()) << "the cut must lie within a packet";
  float youngest_s = 1.0F;
  for (const SweepPoint& point : sweep.points)
    youngest_s = std::min(youngest_s, point.age_s);
  EXPECT_LT(youngest_s, 3 * to_seconds(kColumn));
}

TEST(SweepBuilder, TwoLidarsNeedNoPhaseLock) {
  NumberedLidar front(0, 600, 0);
  NumberedLidar rear(1, 597, 77, kStart + nanoseconds{700'123});
  Built built(keep_all(), 2);
  while (front.next() < kStart + seconds{2})
    built.add(front.next() <= rear.next() ? front.packet() : rear.packet());
  built.builder.finish();
  expect_each_return_in_its_sweep(built.sweeps, {&front, &rear}, kPacket);
  for (const Sweep& sweep : built.sweeps) {
    const auto of_rear =
        std::count_if(sweep.points.begin(), sweep.points.end(), [](const SweepPoint& p) { return p.scan_line >= 256; });
    EXPECT_NEAR(static_cast<double>(of_rear), 0.5 * static_cast<double>(sweep.points.size()),
                0.02 * static_cast<double>(sweep.points.size()));
  }
}

TEST(SweepBuilder, DeadLidarDoesNotHoldUpTheOthers) {
  NumberedLidar front(0), rear(1, 600, 90);
  Built built(keep_all(), 2);
  while (rear.next() < kStart + seconds{2}) {
    if (front.next() < kStart + seconds{1} && front.next() <= rear.next())
      built.add(front.packet()); // dies after one second
    else
      built.add(rear.packet());
  }
  ASSERT_GE(built.sweeps.size(), 19U);
  EXPECT_NEAR(static_cast<double>(built.sweeps[5].points.size()), 2.0 * 28'930, 800);
  for (std::size_t i = 11; i < built.sweeps.size(); ++i) {
    EXPECT_NEAR(to_seconds(built.sweeps[i].end - built.sweeps[i].start), 0.1, 1e-3);
    EXPECT_NEAR(static_cast<double>(built.sweeps[i].points.size()), 28'930, 400);
  }
}

TEST(SweepBuilder, AGapOfTenSecondsYieldsEmptyWindows) {
  NumberedLidar lidar;
  Built built;
  built.play(lidar, seconds{1});
  lidar.skip(seconds{10});
  built.play(lidar, seconds{1});
  const auto empty =
      std::count_if(built.sweeps.begin(), built.sweeps.end(), [](const Sweep& sweep) { return sweep.points.empty(); });
  EXPECT_NEAR(static_cast<double>(empty), 99, 2);
  EXPECT_EQ(built.builder.counters().restarts, 0U);
  expect_each_return_in_its_sweep(built.sweeps, {&lidar});
}

TEST(SweepBuilder, WindowsCloseOnTimeWhenNoPacketComes) {
  NumberedLidar lidar;
  Built built;
  built.play(lidar, seconds{1});
  const std::size_t before = built.sweeps.size();
  built.builder.advance(lidar.next() + seconds{3});
  EXPECT_NEAR(static_cast<double>(built.sweeps.size() - before), 30, 1);
  EXPECT_FALSE(built.sweeps[before].points.empty());
  EXPECT_TRUE(built.sweeps.back().points.empty());
}

TEST(SweepBuilder, WindowsDoNotCloseBeforeTheirTime) {
  NumberedLidar lidar;
  Built built;
  built.play(lidar, milliseconds{950});
  const std::size_t before = built.sweeps.size();
  built.builder.advance(lidar.next() + milliseconds{40});
  EXPECT_EQ(built.sweeps.size(), before);
}

TEST(SweepBuilder, LatePacketIsCountedAndDropped) {
  NumberedLidar lidar;
  Built built;
  const LidarPacket old = lidar.packet();
  built.add(old);
  built.play(lidar, seconds{1});
  const std::size_t before = built.sweeps.size();
  built.add(old);
  EXPECT_EQ(built.builder.counters().late_packets, 1U);
  EXPECT_EQ(built.sweeps.size(), before);
  built.play(lidar, seconds{1});
  expect_each_return_in_its_sweep(built.sweeps, {&lidar});
}

TEST(SweepBuilder, ReorderedPacketsAreNotLost) {
  NumberedLidar lidar;
  Built built;
  while (lidar.next() < kStart + seconds{1}) {
    const LidarPacket first = lidar.packet();
    const LidarPacket second = lidar.packet();
    built.add(second);
    built.add(first);
  }
  built.builder.finish();
  std::map<std::size_t, int> times_seen;
  for (const Sweep& sweep : built.sweeps)
    for (const SweepPoint& point : sweep.points)
      ++times_seen[number_of(point)];
  for (const auto& [number, times] : times_seen)
    ASSERT_EQ(times, 1) << number;
  EXPECT_EQ(built.builder.counters().late_packets, 0U);
  const Stamp end = built.sweeps.back().end;
  for (std::size_t number = 0; number < lidar.count(); ++number) {
    ASSERT_EQ(times_seen[number], lidar.fired(number) < end ? 1 : 0) << number;
  }
}

TEST(SweepBuilder, LastWindowCountsFromHalfAPeriodOn) {
  SweepOptions options = keep_all();
  options.sweep_period = milliseconds{100};
  for (const auto& [played, expected] : {std::pair{940, 9U}, std::pair{960, 10U}}) {
    NumberedLidar lidar;
    Built built(options);
    built.play(lidar, milliseconds{played});
    EXPECT_EQ(built.sweeps.size(), 9U);
    built.builder.finish();
    EXPECT_EQ(built.sweeps.size(), expected) << played << " ms";
    built.builder.finish();
    EXPECT_EQ(built.sweeps.size(), expected) << "the end comes once";
  }
}

/// Clouds with a single stamp for all points. `ends_` holds their ends; a return's number identifies its cloud.
class CloudsOfOneInstant {
 public:
  static constexpr std::size_t kReturns = 6000; ///< more than one packet holds

  explicit CloudsOfOneInstant(Duration period) : period_(period) {}

  /// Advances the builder every 10 ms until the cloud arrives.
  void play(Built& built, Stamp end) {
    constexpr Duration kWay = milliseconds{4};
    for (Stamp now = ends_.empty() ? end : ends_.back() + kWay; now < end + kWay; now += milliseconds{10})
      built.builder.advance(now);
    ends_.push_back(end);
    for (std::size_t left = kReturns / FiringGroup::kLasers; left > 0;) {
      LidarPacket packet;
      packet.count = std::min(left, LidarPacket::kMaxFiringGroups);
      left -= packet.count;
      packet.cloud = {end - period_, end, left == 0};
      packet.stamp = end - Duration{1};
      packet.duration = Duration{1};
      packet.first_azimuth_cdeg = 35'999;
      for (std::size_t i = 0; i < packet.count; ++i) {
        packet.storage[i] = {};
        packet.storage[i].range_m.fill(5.0F);
        packet.storage[i].x_m.fill(5.0F);
      }
      built.builder.add(packet, end + kWay);
    }
  }
  [[nodiscard]] const std::vector<Stamp>& ends() const { return ends_; }

 private:
  Duration period_;
  std::vector<Stamp> ends_;
};

void expect_a_sweep_of_each(const std::vector<Stamp>& clouds, const std::vector<Sweep>& sweeps) {
  ASSERT_EQ(sweeps.size(), clouds.size());
  for (std::size_t i = 0; i < sweeps.size(); ++i) {
    EXPECT_EQ(sweeps[i].raw_returns, CloudsOfOneInstant::kReturns) << i;
    EXPECT_EQ(sweeps[i].end, clouds[i]) << i;
    EXPECT_EQ(sweeps[i].start, i == 0 ? sweeps[i].start : clouds[i - 1]) << i;
  }
}

TEST(SweepBuilder, EachCloudOfOneInstantIsASweep) {
  for (const double rate_hz : {5.0, 9.9, 10.0, 10.1, 20.0}) {
    for (const Duration jitter : {Duration{}, Duration{300'000}, Duration{3'000'000}}) {
      SCOPED_TRACE(testing::Message() << rate_hz << " Hz, to " << jitter.count() << " ns");
      CloudsOfOneInstant clouds(from_seconds(1 / rate_hz));
      Built built;
      for (int k = 1; k <= 40; ++k)
        clouds.play(built, kStart + from_seconds(k / rate_hz) + jitter * (k * 7 % 5 - 2) / 2);
      expect_a_sweep_of_each(clouds.ends(), built.sweeps);
    }
  }
}

TEST(RevolutionTimer, KnowsTheSpeedAfterOneRevolution) {
  for (const double rpm : {300.0, 599.0, 600.0, 901.0, 1200.0}) {
    RevolutionTimer timer;
    NumberedLidar lidar(0, rpm, 200);
    while (lidar.next() < kStart + from_seconds(60.0 / rpm))
      timer.observe(lidar.packet());
    EXPECT_NEAR(to_seconds(timer.period()), 60.0 / rpm, 2e-4 * 60.0 / rpm) << rpm;
  }
}

TEST(RevolutionTimer, IgnoresGapsAndOtherLidars) {
  RevolutionTimer timer;
  NumberedLidar front(0, 600), rear(1, 1200);
  for (int i = 0; i < 300; ++i) {
    timer.observe(rear.packet());
    timer.observe(front.packet());
    if (i % 100 == 50)
      front.skip(seconds{3} + milliseconds{33});
  }
  EXPECT_NEAR(to_seconds(timer.period()), 0.1, 2e-5);
}

} // namespace
} // namespace locus::test
