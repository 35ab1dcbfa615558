// SPDX-License-Identifier: Apache-2.0
#include "drivers/sensor_time.hpp"

#include <gtest/gtest.h>

namespace locus {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

constexpr Stamp kNow{seconds{1'726'766'428}};

TEST(SensorTime, ScaleIsInferredFromTheArrival) {
  const Duration now = kNow.time_since_epoch();
  for (const bool is_set_to_ptp : {false, true}) {
    EXPECT_EQ(scale_of(is_set_to_ptp, seconds{866}, kNow), TimeScale::free_running) << "since its start";
    EXPECT_EQ(scale_of(is_set_to_ptp, now - milliseconds{3}, kNow), TimeScale::utc);
    EXPECT_EQ(scale_of(is_set_to_ptp, now + seconds{37} - milliseconds{3}, kNow), TimeScale::tai);
  }
}

TEST(SensorTime, PtpIsTaiWhateverTheHostClock) {
  const Duration hour_ago = kNow.time_since_epoch() - seconds{3600};
  EXPECT_EQ(scale_of(true, hour_ago, kNow), TimeScale::tai);
  EXPECT_EQ(scale_of(false, hour_ago, kNow), TimeScale::free_running);
}

TEST(SensorTime, PastTheHourIsUtc) {
  EXPECT_EQ(time_of_hour(seconds{7205}, TimeScale::utc), seconds{5});
  EXPECT_EQ(time_of_hour(seconds{7205}, TimeScale::free_running), seconds{5});
  EXPECT_EQ(time_of_hour(seconds{7205}, TimeScale::tai), seconds{3568});
  EXPECT_EQ(time_of_hour(seconds{0}, TimeScale::tai), seconds{3563});
}

} // namespace
} // namespace locus
