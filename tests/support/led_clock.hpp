// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <cstdint>

namespace locus::test {

/// Layout of the file LED_CLOCK, shared by all programs that preload led_clock.cpp: the time set by the player, and the
/// service's progress. All zero: system time.
struct LedTime {
  std::atomic<std::int32_t> is_led{0};                     ///< time advances only by `added_ns`
  std::int64_t wall_ns = 0, monotonic_ns = 0, boot_ns = 0; ///< time at takeover
  std::atomic<std::int64_t> added_ns{0};                   ///< since takeover
  std::atomic<std::int64_t> offset_ns{0};             ///< controlled time minus system time after the control has ended
  std::atomic<std::uint64_t> datagrams{0}, motion{0}; ///< processed by the service's ingest

  // Written by the test.
  std::atomic<std::int64_t> set_by_ns{0};  ///< step of the service's wall clock; may change at any time
  std::atomic<std::int64_t> hold_at_ns{0}; ///< `added_ns` at which the player waits for another value; 0: never
  std::atomic<std::int64_t> held_at_ns{0}; ///< `hold_at_ns` at which the player waits or has waited last
};

} // namespace locus::test
