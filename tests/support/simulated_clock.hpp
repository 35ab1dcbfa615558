// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

namespace locus::test {

/// Layout of the file SIMULATED_CLOCK: the time of all programs that preload simulated_clock.cpp and share this file.
/// All zero: system time.
struct SimulatedTime {
  std::int64_t set_by_ns = 0;          ///< step of the wall clock; may change at any time
  double rate = 0;                     ///< simulated seconds per system second; 0: 1
  std::int64_t origin_ns = 0;          ///< system CLOCK_MONOTONIC from which the rate applies
  std::int64_t wall_minus_origin_ns{}; ///< system CLOCK_REALTIME - CLOCK_MONOTONIC at the origin
  std::int64_t boot_minus_origin_ns{}; ///< CLOCK_BOOTTIME likewise
};

} // namespace locus::test
