// SPDX-License-Identifier: Apache-2.0
#include "daemon/steady_time.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <ctime>
#include <random>

namespace locus::daemon {
namespace {

using std::chrono::hours;
using std::chrono::milliseconds;
using std::chrono::seconds;

Duration since_boot, wall_ahead; ///< clocks of the host

Duration host_clock(clockid_t id) { return since_boot + (id == CLOCK_REALTIME ? wall_ahead : Duration::zero()); }

class SteadyTimeTest : public testing::Test {
 protected:
  void SetUp() override {
    since_boot = seconds{100};
    wall_ahead = seconds{1'700'000'000};
  }
};

constexpr Stamp kBoot{seconds{1'700'000'000}};

/// A sensor with a latency between stamp and arrival, and the largest final error of both.
struct Case {
  bool by_host; ///< else by its own clock
  Duration step, period, lag, jitter;
};

TEST_F(SteadyTimeTest, StampsAreUnaffectedByStepsOfAnySize) {
  for (const Case& c : {Case{true, milliseconds{6}, milliseconds{5}, milliseconds{3}, milliseconds{1}},
                        {true, milliseconds{20}, milliseconds{10}, milliseconds{10}, milliseconds{3}},
                        {true, milliseconds{20}, milliseconds{20}, milliseconds{30}, milliseconds{5}},
                        {true, milliseconds{50}, milliseconds{33}, milliseconds{60}, milliseconds{5}},
                        {true, milliseconds{100}, milliseconds{20}, milliseconds{50}, milliseconds{5}},
                        {true, -milliseconds{50}, milliseconds{33}, milliseconds{60}, milliseconds{5}},
                        {true, hours{1}, milliseconds{50}, milliseconds{200}, milliseconds{20}},
                        {true, -hours{1}, milliseconds{50}, milliseconds{200}, milliseconds{20}},
                        {true, hours{24 * 400}, milliseconds{5}, milliseconds{1}, milliseconds{1}},
                        {false, milliseconds{20}, milliseconds{10}, milliseconds{10}, milliseconds{3}},
                        {false, -milliseconds{20}, milliseconds{10}, milliseconds{10}, milliseconds{3}},
                        {false, -milliseconds{50}, milliseconds{33}, milliseconds{60}, milliseconds{5}},
                        {false, -milliseconds{50}, milliseconds{20}, milliseconds{25}, milliseconds{5}},
                        {false, hours{1}, milliseconds{5}, milliseconds{1}, milliseconds{1}}}) {
    SetUp();
    SteadyTime time(host_clock);
    SteadyTime::Sender sender;
    std::mt19937 random{1};
    Duration worst{}, worst_arrival{};
    int unlike = 0;
    for (int i = 0; i < 4000; ++i) {
      since_boot = seconds{100} + i * c.period;
      const Duration lag =
          c.lag + Duration{static_cast<std::int64_t>(random() % 2001) - 1000} * (c.jitter / milliseconds{1}) * 1000;
      const Duration made_at = since_boot - lag;
      const bool is_set = since_boot >= seconds{110};
      wall_ahead = seconds{1'700'000'000} + (is_set ? c.step : Duration{});
      const bool made_after = made_at >= seconds{110};
      const Stamp stamp = kBoot + made_at + (c.by_host && made_after ? c.step : Duration{});
      const Stamp arrived{since_boot + wall_ahead};
      time.detect_step();
      const Stamp arrival = time.to_steady(arrived);
      const Duration off = std::chrono::abs(time.to_steady(stamp, arrival, sender) - (kBoot + made_at));
      unlike += off > milliseconds{1} ? 1 : 0;
      worst = std::max(worst, since_boot > seconds{113} ? off : Duration{});
      worst_arrival = std::max(worst_arrival, std::chrono::abs(arrival - (kBoot + since_boot)));
    }
    const std::string what = testing::PrintToString(to_seconds(c.step)) + (c.by_host ? " s, host" : " s, own clock");
    EXPECT_EQ(worst, Duration{}) << what;
    EXPECT_LE(worst_arrival, milliseconds{1}) << what;
    EXPECT_LE(unlike, 2) << what;
  }
}

TEST_F(SteadyTimeTest, ArrivalBeforeTheStepConvertsAfterIt) {
  for (const Duration step : {Duration{milliseconds{20}}, Duration{hours{1}}, Duration{-hours{1}}}) {
    SetUp();
    SteadyTime time(host_clock);
    const Stamp made{since_boot + wall_ahead};
    since_boot += milliseconds{2};
    wall_ahead += step;
    time.detect_step();
    EXPECT_EQ(time.to_steady(made), kBoot + seconds{100});
    EXPECT_EQ(time.to_steady(Stamp{since_boot + wall_ahead}), kBoot + seconds{100} + milliseconds{2});
    EXPECT_EQ(time.to_wall(kBoot), kBoot + step);
    EXPECT_EQ(time.steps(), step);
  }
}

TEST_F(SteadyTimeTest, ArrivalBetweenStepAndDetectionConverts) {
  for (const Duration step :
       {Duration{milliseconds{20}}, Duration{-milliseconds{20}}, Duration{hours{1}}, Duration{-hours{1}}}) {
    SetUp();
    SteadyTime time(host_clock);
    wall_ahead += step;
    since_boot += milliseconds{1};
    const Stamp made{since_boot + wall_ahead};
    since_boot += milliseconds{1};
    time.detect_step();
    EXPECT_EQ(time.to_steady(made), kBoot + seconds{100} + milliseconds{1}) << to_seconds(step);
  }
}

TEST_F(SteadyTimeTest, SlewIsNoStep) {
  SteadyTime time(host_clock);
  for (int i = 0; i < 1000; ++i) {
    since_boot += milliseconds{2};
    wall_ahead += std::chrono::microseconds{i % 2 == 0 ? 900 : -900};
    time.detect_step();
  }
  EXPECT_EQ(time.steps(), Duration{});
}

} // namespace
} // namespace locus::daemon
