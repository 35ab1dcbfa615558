// SPDX-License-Identifier: Apache-2.0
#include "simulated_time/fault_schedule.hpp"

#include <algorithm>
#include <cmath>
#include <random>

#include <fmt/format.h>

namespace locus::test {
namespace {

constexpr Duration kQuiet = std::chrono::seconds{30}; ///< at the beginning and at the end

/// Range of a fault's duration in seconds, log-uniformly distributed. Zero: instantaneous.
struct Span {
  double least_s, most_s;
};
constexpr std::array<Span, kDayFaults> kSpans{{{0, 0},
                                               {0.1, 8},
                                               {0.1, 8},
                                               {0, 0},
                                               {1, 180},
                                               {1, 180},
                                               {1, 180},
                                               {1, 90},
                                               {1, 30},
                                               {0.5, 3},
                                               {1, 30},
                                               {1, 30},
                                               {5, 60},
                                               {0, 0},
                                               {0, 0},
                                               {1, 20},
                                               {1, 20}}};

constexpr std::array<const char*, 6> kThreads{"locusd", "ingest", "odometry", "publisher", "dds", "disk"};

/// Portable random numbers: distributions of the standard library differ between versions, and so would the faults of a
/// seed.
class Chance {
 public:
  explicit Chance(std::uint64_t seed) : random_(seed) {}
  double share() { return static_cast<double>(random_() >> 11) * 0x1p-53; }
  std::size_t below(std::size_t count) { return random_() % count; }
  /// Returns a log-uniformly distributed duration.
  Duration between(double least_s, double most_s) {
    return from_seconds(least_s * std::pow(most_s / least_s, share()));
  }

 private:
  std::mt19937_64 random_;
};

} // namespace

std::string to_text(const ScheduledFault& fault) {
  const std::string what = fault.kind == DayFault::clock_step    ? fmt::format(" by {:+.3f} s", to_seconds(fault.step))
                           : fault.kind == DayFault::thread_hang ? " " + fault.thread
                                                                 : "";
  const std::string how_long =
      fault.lasts == Duration::zero() ? "" : fmt::format(" for {:.2f} s", to_seconds(fault.lasts));
  return fmt::format("{:9.2f} s: {}{}{}", to_seconds(fault.begin), to_string(fault.kind), what, how_long);
}

std::vector<ScheduledFault> schedule_faults(std::uint64_t seed, Duration day, Duration mean_pause) {
  constexpr double kLeastStep_s = 0.02, kMostStep_s = 6 * 3600;
  Chance chance(seed);
  std::vector<ScheduledFault> faults;
  std::array<Duration, kDayFaults> busy_until{};
  for (Duration at = kQuiet;;) {
    at += from_seconds(-std::log(1 - chance.share()) * to_seconds(mean_pause));
    ScheduledFault fault;
    const std::size_t kind = chance.below(kDayFaults);
    fault.kind = static_cast<DayFault>(kind);
    fault.begin = at;
    fault.lasts = kSpans[kind].most_s > 0 ? chance.between(kSpans[kind].least_s, kSpans[kind].most_s) : Duration{};
    const Duration step = chance.between(kLeastStep_s, kMostStep_s);
    fault.step = chance.share() < 0.5 ? step : -step;
    fault.thread = kThreads[chance.below(kThreads.size())];
    if (fault.end() > day - kQuiet)
      return faults;
    if (fault.begin <= busy_until[kind])
      continue;
    busy_until[kind] = fault.end() + std::chrono::seconds{1};
    faults.push_back(std::move(fault));
  }
}

} // namespace locus::test
