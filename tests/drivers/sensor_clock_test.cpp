// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <vector>

#include "drivers/sensor_clock.hpp"

namespace locus {
namespace {

using std::chrono::hours;
using std::chrono::microseconds;
using std::chrono::milliseconds;
using std::chrono::nanoseconds;
using std::chrono::seconds;

constexpr Duration kPacket = nanoseconds{1'327'104};
constexpr std::int64_t kEpoch = 1'700'000'000'000'000'000;

/// A sensor with a clock of its own, and its network.
struct Link {
  Duration sensor_ahead{};           ///< relative to the host's clock, at the start
  double drift = 0.0;                ///< of the sensor's clock
  Stamp now = stamp_from_ns(kEpoch); ///< true time of the next packet's first firing
  Stamp started = now;

  [[nodiscard]] Duration time_of_hour() const {
    const Duration sensor = now.time_since_epoch() + sensor_ahead + from_seconds(drift * to_seconds(now - started));
    return std::chrono::floor<microseconds>(sensor % hours{1});
  }

  /// Sends a packet; returns the error of its stamp.
  std::optional<Duration> send(SensorClock& clock, Duration delay = microseconds{100}) {
    const auto reading = clock.read(time_of_hour(), kPacket, now + kPacket + delay);
    const Stamp fired = now;
    now += kPacket;
    return reading ? std::optional{reading->stamp - fired} : std::nullopt;
  }
};

TEST(SensorClock, NetworkJitterDoesNotReachTheStamps) {
  SensorClock clock{LidarTime::receive};
  Link link{.sensor_ahead = seconds{-700}, .drift = 50e-6};
  std::mt19937 random{1};
  std::exponential_distribution<double> jitter_s{1.0 / 2e-3};
  Stamp settled = link.now + seconds{3};
  Duration worst{};
  while (link.now < stamp_from_ns(kEpoch) + seconds{60}) {
    const bool counts = link.now > settled;
    const auto error = link.send(clock, microseconds{100} + from_seconds(jitter_s(random)));
    ASSERT_TRUE(error);
    if (counts)
      worst = std::max(worst, std::chrono::abs(*error - microseconds{100}));
  }
  EXPECT_LT(worst, microseconds{200}) << "under 2 ms of mean jitter and 50 ppm of drift";
  EXPECT_EQ(clock.steps(), 0U);
}

TEST(SensorClock, DurationsComeFromTheSensorsClock) {
  SensorClock clock{LidarTime::receive};
  Link link;
  std::optional<Stamp> last;
  for (int i = 0; i < 5'000; ++i) {
    const auto reading = clock.read(link.time_of_hour(), kPacket, link.now + kPacket + microseconds{i % 7 * 300});
    ASSERT_TRUE(reading);
    if (last) {
      EXPECT_LE(std::chrono::abs(reading->stamp - *last - kPacket), microseconds{3});
    }
    last = reading->stamp;
    link.now += kPacket;
  }
}

TEST(SensorClock, LateFirstPacketIsCorrectedWithinASecond) {
  SensorClock clock{LidarTime::receive};
  Link link;
  link.send(clock, milliseconds{15});
  std::optional<Duration> error;
  Duration last_error = milliseconds{15};
  for (int i = 0; i < 700; ++i) {
    error = link.send(clock);
    ASSERT_TRUE(error);
    ASSERT_GT(*error + kPacket, last_error) << "stamps never run backwards";
    last_error = *error;
  }
  EXPECT_LT(*error, microseconds{150});
  EXPECT_EQ(clock.steps(), 0U);
}

TEST(SensorClock, HourRollOverIsSeamless) {
  for (const LidarTime mode : {LidarTime::receive, LidarTime::sensor, LidarTime::automatic}) {
    SensorClock clock{mode};
    Link link;
    const Stamp top_of_hour{std::chrono::ceil<hours>(link.now.time_since_epoch())};
    link.now = top_of_hour - seconds{1};
    while (link.now < top_of_hour + seconds{1}) {
      const auto error = link.send(clock);
      ASSERT_TRUE(error);
      ASSERT_LT(std::chrono::abs(*error), microseconds{150});
    }
    EXPECT_EQ(clock.steps(), 0U);
  }
}

TEST(SensorClock, FewHoursOfSilenceAreNoStep) {
  SensorClock clock{LidarTime::receive};
  Link link{.sensor_ahead = seconds{1234}};
  link.send(clock);
  link.now += hours{5} + seconds{7};
  const auto error = link.send(clock);
  ASSERT_TRUE(error);
  EXPECT_LT(std::chrono::abs(*error), microseconds{150});
  EXPECT_EQ(clock.steps(), 0U);
}

/// The step looks like an hour of silence, and nothing tells how many packets were lost.
TEST(SensorClock, HostClockStepOfAnHourIsNoGap) {
  for (const LidarTime mode : {LidarTime::receive, LidarTime::sensor}) {
    for (const Duration step : {Duration{hours{1}}, Duration{-hours{1}}}) {
      SensorClock clock{mode};
      Link link;
      for (int i = 0; i < 1000; ++i)
        link.send(clock);
      link.now += step;
      Duration most{};
      for (int i = 0; i < 10; ++i, link.now += kPacket)
        if (const auto reading = clock.read(link.time_of_hour(), kPacket, link.now + kPacket))
          most = std::max(most, reading->continuous ? reading->advance : Duration{});
      EXPECT_LE(most, 10 * kPacket) << to_seconds(step);
      EXPECT_LE(clock.steps(), 1U);
    }
  }
}

/// A robot without a clock battery gets the time of day minutes after it has booted. From then on the lidar's UTC
/// agrees with the wall clock, while internal time is continuous.
TEST(SensorClock, CorrectedHostClockMakesUtcTrusted) {
  constexpr Duration kHostIsSlow = seconds{600};
  for (const LidarTime mode : {LidarTime::sensor, LidarTime::automatic}) {
    SensorClock clock{mode};
    clock.set_synchronised(true);
    Link link{.sensor_ahead = kHostIsSlow};
    for (int i = 0; i < 3000; ++i)
      link.send(clock, milliseconds{3});
    std::optional<Duration> error;
    for (int i = 0; i < 20; ++i, link.now += kPacket)
      if (const auto reading =
              clock.read(link.time_of_hour(), kPacket, link.now + kPacket + milliseconds{3}, kHostIsSlow))
        error = reading->stamp - link.now;
    ASSERT_TRUE(error);
    EXPECT_LE(std::chrono::abs(*error), microseconds{1}) << "not by the delay of its way";
    EXPECT_EQ(clock.steps(), 0U);
  }
}

TEST(SensorClock, SensorTimeUsesTheHourOfReception) {
  SensorClock clock{LidarTime::sensor};
  Link link{.sensor_ahead = milliseconds{368}};
  for (int i = 0; i < 100; ++i) {
    const auto error = link.send(clock, milliseconds{std::abs(i % 100 - 50)});
    ASSERT_TRUE(error);
    EXPECT_LE(std::chrono::abs(*error - milliseconds{368}), microseconds{1});
  }
}

TEST(SensorClock, AutomaticUsesSensorTimeOnlyIfSynchronisedAndConsistent) {
  const auto error_after = [](Duration ahead, bool synchronised) {
    SensorClock clock{LidarTime::automatic};
    clock.set_synchronised(synchronised);
    Link link{.sensor_ahead = ahead};
    link.send(clock);
    return link.send(clock).value();
  };
  EXPECT_LE(std::chrono::abs(error_after(milliseconds{2}, true) - milliseconds{2}), microseconds{1});
  EXPECT_NEAR(to_seconds(error_after(milliseconds{2}, false)), 100e-6, 2e-6);
  EXPECT_NEAR(to_seconds(error_after(milliseconds{368}, true)), 100e-6, 2e-6) << "the host's clock is not on UTC";
}

TEST(SensorClock, LatePacketsDoNotAffectSensorTime) {
  SensorClock clock{LidarTime::automatic};
  clock.set_synchronised(true);
  Link link{.sensor_ahead = milliseconds{2}};
  for (int i = 0; i < 9000; ++i) {
    const bool late = i >= 3000 && i < 6000;
    const auto error = link.send(clock, late ? milliseconds{200} : microseconds{100});
    ASSERT_TRUE(error);
    ASSERT_LE(std::chrono::abs(*error - milliseconds{2}), microseconds{1});
  }
  EXPECT_EQ(clock.steps(), 0U);
}

TEST(SensorClock, HalfAMinuteOfLatePacketsRevealsAWrongClock) {
  SensorClock clock{LidarTime::automatic};
  clock.set_synchronised(true);
  Link link;
  link.send(clock);
  for (const Stamp end = link.now + seconds{35}; link.now < end;)
    link.send(clock, milliseconds{50});
  EXPECT_LT(std::chrono::abs(link.send(clock, milliseconds{50}).value() - milliseconds{50}), microseconds{150});
  EXPECT_EQ(clock.steps(), 1U);
}

TEST(SensorClock, SensorTimeEndsWithTheLockOrAClockStep) {
  for (const Duration step : {Duration{-milliseconds{500}}, Duration{seconds{-10}}, Duration{seconds{10}}}) {
    SensorClock clock{LidarTime::automatic};
    clock.set_synchronised(true);
    Link link;
    for (int i = 0; i < 1000; ++i)
      link.send(clock);
    link.sensor_ahead += step;
    for (int i = 0; i < 1000; ++i)
      link.send(clock);
    EXPECT_EQ(clock.steps(), 1U);
    EXPECT_LT(std::chrono::abs(link.send(clock).value()), microseconds{150}) << "by reception: one is not on UTC";
    link.sensor_ahead -= step;
    for (int i = 0; i < 1000; ++i)
      link.send(clock);
    EXPECT_LE(std::chrono::abs(link.send(clock).value()), microseconds{1}) << "both are again";
  }
  SensorClock clock{LidarTime::automatic};
  clock.set_synchronised(true);
  Link link{.sensor_ahead = milliseconds{2}};
  link.send(clock);
  clock.set_synchronised(false);
  for (int i = 0; i < 9000; ++i)
    link.send(clock);
  EXPECT_LT(std::chrono::abs(link.send(clock).value()), microseconds{150});
  EXPECT_EQ(clock.steps(), 0U) << "the zero of the ruler has moved, not the clock";
}

TEST(SensorClock, ClockStepIsFollowed) {
  for (const LidarTime mode : {LidarTime::receive, LidarTime::sensor}) {
    for (const Duration step : {Duration{seconds{10}}, Duration{seconds{-10}}, Duration{-milliseconds{500}}}) {
      SensorClock clock{mode};
      Link link;
      for (int i = 0; i < 1000; ++i)
        link.send(clock);
      link.sensor_ahead += step;
      int refused = 0;
      for (int i = 0; i < 1000; ++i)
        refused += link.send(clock) ? 0 : 1;
      EXPECT_EQ(refused, 4) << "the fifth proves it";
      EXPECT_EQ(clock.steps(), 1U);
      const Duration error = link.send(clock).value();
      const Duration wanted = mode == LidarTime::sensor ? step : Duration{};
      EXPECT_LT(std::chrono::abs(error - wanted), microseconds{150});
    }
  }
}

TEST(SensorClock, PacketBurstAfterSecondsIsNoStep) {
  for (const Duration held_up : {Duration{milliseconds{1500}}, Duration{seconds{5}}}) {
    SensorClock clock{LidarTime::receive};
    Link link;
    for (int i = 0; i < 2000; ++i)
      link.send(clock);
    const Stamp released = link.now + held_up;
    int refused = 0;
    for (int i = 0; link.now < released; ++i) {
      const auto error = link.send(clock, released - link.now + i * microseconds{10});
      refused += error ? 0 : 1;
      EXPECT_LT(std::chrono::abs(error.value_or(Duration{})), microseconds{150});
    }
    EXPECT_NEAR(refused, to_seconds(held_up - seconds{1}) / to_seconds(kPacket), 30.0)
        << "those that are later than a network ever is";
    ASSERT_TRUE(link.send(clock));
    EXPECT_EQ(clock.steps(), 0U);
  }
}

TEST(SensorClock, PausedBurstCostsFewPackets) {
  SensorClock clock{LidarTime::receive};
  Link link;
  for (int i = 0; i < 2000; ++i)
    link.send(clock);
  const Stamp released = link.now + seconds{5};
  for (int i = 0; link.now < released; ++i)
    link.send(clock, released - link.now + (i < 3 ? Duration{} : milliseconds{5}));
  int refused = 0;
  for (int i = 0; i < 1000; ++i)
    refused += link.send(clock) ? 0 : 1;
  EXPECT_LT(refused * kPacket, milliseconds{150});
}

TEST(SensorClock, StartWithinABurstIsCorrectedAtOnce) {
  SensorClock clock{LidarTime::receive};
  Link link;
  const Stamp released = link.now + seconds{2};
  while (link.now < released)
    link.send(clock, released - link.now);
  int refused = 0;
  for (int i = 0; i < 2000; ++i)
    refused += link.send(clock) ? 0 : 1;
  EXPECT_LT(refused * kPacket, milliseconds{50});
  const auto error = link.send(clock);
  ASSERT_TRUE(error);
  EXPECT_LT(std::chrono::abs(*error), microseconds{150});
}

TEST(SensorClock, BatchedPacketsAreAcceptedFromTheThirdOn) {
  SensorClock clock{LidarTime::receive};
  Link link;
  const Duration batch = milliseconds{100};
  for (int i = 0; i < 2000; ++i) {
    const Duration waits = batch - link.now.time_since_epoch() % batch;
    const auto error = link.send(clock, waits);
    if (link.now > link.started + 2 * batch) {
      ASSERT_TRUE(error) << i;
    }
  }
}

TEST(SensorClock, TwentyfoldReplayContinuesAfterAGap) {
  SensorClock clock{LidarTime::sensor};
  Link link;
  Stamp receive = link.now;
  int refused = 0;
  for (int i = 0; i < 2000; ++i) {
    refused += clock.read(link.time_of_hour(), kPacket, receive) ? 0 : 1;
    link.now += i == 1000 ? 200 * kPacket : kPacket;
    receive += kPacket / 20;
  }
  EXPECT_EQ(refused, 4) << "the fifth proves it";
}

TEST(SensorClock, SingleWrongTimesAreRejected) {
  SensorClock clock{LidarTime::receive};
  Link link;
  for (int i = 0; i < 2000; ++i) {
    if (i % 100 == 50) {
      EXPECT_EQ(clock.read(seconds{i}, kPacket, link.now), std::nullopt);
    }
    const auto error = link.send(clock);
    ASSERT_TRUE(error);
    EXPECT_LT(std::chrono::abs(*error), microseconds{150});
  }
  EXPECT_EQ(clock.steps(), 0U);
}

TEST(SensorClock, BackwardTimeIsNeverTrusted) {
  SensorClock clock{LidarTime::receive};
  Duration time_of_hour = seconds{1800};
  ASSERT_TRUE(clock.read(time_of_hour, kPacket, stamp_from_ns(kEpoch)));
  int refused = 0;
  for (int i = 1; i <= 1000; ++i) {
    time_of_hour -= kPacket;
    refused += clock.read(time_of_hour, kPacket, stamp_from_ns(kEpoch) + i * kPacket) ? 0 : 1;
  }
  EXPECT_GE(refused, 900) << "all but those that may have been overtaken";
  EXPECT_EQ(clock.steps(), 0U);
}

TEST(SensorClock, DriftBeyondFiveHundredPpmIsCountedAsStepsAndFollowed) {
  SensorClock clock{LidarTime::receive};
  Link link{.drift = 2000e-6};
  Duration worst{};
  while (link.now < stamp_from_ns(kEpoch) + seconds{60})
    if (const auto error = link.send(clock))
      worst = std::max(worst, std::chrono::abs(*error));
  EXPECT_GE(clock.steps(), 5U);
  EXPECT_LE(clock.steps(), 40U);
  EXPECT_LT(worst, milliseconds{8});
}

TEST(SensorClock, DriftBelowFiveHundredPpmIsFollowedWithoutAStep) {
  for (const double drift : {-400e-6, 400e-6}) {
    SensorClock clock{LidarTime::receive};
    Link link{.drift = drift};
    Duration worst{};
    while (link.now < stamp_from_ns(kEpoch) + seconds{30}) {
      const auto error = link.send(clock);
      ASSERT_TRUE(error);
      worst = std::max(worst, std::chrono::abs(*error));
    }
    EXPECT_LT(worst, milliseconds{1});
    EXPECT_EQ(clock.steps(), 0U);
  }
}

TEST(SensorClock, ReplayAtTenTimesTheSpeedWorksInSensorTime) {
  SensorClock clock{LidarTime::sensor};
  Link link;
  for (int i = 0; i < 10'000; ++i) {
    ASSERT_TRUE(clock.read(link.time_of_hour(), kPacket, stamp_from_ns(kEpoch) + i * kPacket / 10));
    link.now += kPacket;
  }
  EXPECT_EQ(clock.steps(), 0U);
}

TEST(SensorClock, AnyStampsAreSurvived) {
  std::mt19937_64 random{5};
  std::uniform_int_distribution<std::int64_t> hour{0, hours{1} / nanoseconds{1} - 1};
  std::uniform_int_distribution<std::int64_t> stamp{0, 9'000'000'000'000'000'000};
  for (const LidarTime mode : {LidarTime::receive, LidarTime::sensor, LidarTime::automatic}) {
    SensorClock clock{mode};
    clock.set_synchronised(true);
    int taken = 0;
    for (int i = 0; i < 20'000; ++i)
      taken += clock.read(Duration{hour(random)}, kPacket, stamp_from_ns(stamp(random))) ? 1 : 0;
    EXPECT_GT(taken, 0);
  }
}

} // namespace
} // namespace locus
