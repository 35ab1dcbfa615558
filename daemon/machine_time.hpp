// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <ctime>

#include "core/base/stamp.hpp"

namespace locus::daemon {

/// Reads one of the system's clocks, e.g. CLOCK_MONOTONIC. Any thread.
inline Duration read_clock(clockid_t clock) noexcept {
  timespec now{};
  clock_gettime(clock, &now);
  return std::chrono::seconds{now.tv_sec} + Duration{now.tv_nsec};
}

inline timespec to_timespec(Duration duration) noexcept {
  const auto whole = std::chrono::duration_cast<std::chrono::seconds>(duration);
  return {static_cast<time_t>(whole.count()), static_cast<long>((duration - whole).count())};
}

/// What the machine spends, as an instant or as the difference of two. It measures cost and paces threads; the time of
/// measurements is Stamp.
struct MachineTime {
  Duration wall{}; ///< CLOCK_MONOTONIC
  Duration cpu{};  ///< of all threads of the process: the odometry's helpers count

  static MachineTime now() noexcept { return {read_clock(CLOCK_MONOTONIC), read_clock(CLOCK_PROCESS_CPUTIME_ID)}; }
  friend MachineTime operator-(const MachineTime& a, const MachineTime& b) { return {a.wall - b.wall, a.cpu - b.cpu}; }
};

} // namespace locus::daemon
