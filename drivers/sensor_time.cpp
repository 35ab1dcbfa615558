// SPDX-License-Identifier: Apache-2.0
#include "drivers/sensor_time.hpp"

namespace locus {

TimeScale scale_of(bool is_set_to_ptp, Duration sensor_time, Stamp receive) {
  constexpr Duration kTolerance = kTaiAheadOfUtc / 2;
  constexpr Duration kLongestOn = std::chrono::hours{24 * 365 * 20};
  const Duration ahead = sensor_time - receive.time_since_epoch();
  if (std::chrono::abs(ahead) < kTolerance)
    return TimeScale::utc;
  const bool is_of_epoch = is_set_to_ptp && sensor_time > kLongestOn;
  return is_of_epoch || std::chrono::abs(ahead - kTaiAheadOfUtc) <= kTolerance ? TimeScale::tai
                                                                               : TimeScale::free_running;
}

Duration time_of_hour(Duration sensor_time, TimeScale scale) {
  const Duration hour = std::chrono::hours{1};
  const Duration ahead = scale == TimeScale::tai ? kTaiAheadOfUtc : Duration{};
  return (sensor_time + hour - ahead) % hour;
}

} // namespace locus
