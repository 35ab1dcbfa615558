// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

namespace locus::test {

/// What the file SIMULATED_CLOCK holds: the time of all programs that have the library of simulated_clock.cpp preloaded
/// and this file in common. All zero it is that of the system.
struct SimulatedTime {
  std::int64_t set_by_ns = 0;          ///< the wall clock is off by so much; may be changed at any time
  double rate = 0;                     ///< so many times as fast as the system's; 0: as fast
  std::int64_t origin_ns = 0;          ///< CLOCK_MONOTONIC of the system from which on it is faster
  std::int64_t wall_minus_origin_ns{}; ///< the system's CLOCK_REALTIME against CLOCK_MONOTONIC, at the origin
  std::int64_t boot_minus_origin_ns{}; ///< CLOCK_BOOTTIME likewise
};

} // namespace locus::test
