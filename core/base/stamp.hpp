// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <cstdint>

namespace locus {

using Duration = std::chrono::nanoseconds;

/// The robot's time line. It has no now(): the core receives the time with every measurement and never reads a clock,
/// so a replay and a live run of the same data are the same computation.
struct RobotTime {
  using duration = Duration;
  using rep = Duration::rep;
  using period = Duration::period;
  using time_point = std::chrono::time_point<RobotTime, Duration>;
  static constexpr bool is_steady = false;
};

/// Instant of a measurement: nanoseconds since the Unix epoch.
using Stamp = RobotTime::time_point;

/// Range of stamps accepted from files, the years 1951 to 2096: a difference of two differences of stamps fits a
/// Duration.
inline constexpr Stamp kEarliestStamp{std::chrono::seconds{-600'000'000}};
inline constexpr Stamp kLatestStamp{std::chrono::seconds{4'000'000'000}};

constexpr Stamp stamp_from_ns(std::int64_t ns) { return Stamp{Duration{ns}}; }
constexpr std::int64_t to_ns(Stamp stamp) { return stamp.time_since_epoch().count(); }

constexpr double to_seconds(Duration duration) { return std::chrono::duration<double>(duration).count(); }

/// Rounds to the nearest nanosecond. `seconds` must be finite and below 2^63 ns (292 years).
constexpr Duration from_seconds(double seconds) {
  return Duration{static_cast<Duration::rep>(seconds * 1e9 + (seconds < 0 ? -0.5 : 0.5))};
}

} // namespace locus
