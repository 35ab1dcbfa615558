// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <cstdint>

namespace locus::test {

/// What the file LED_CLOCK holds, which programs have in common that have the library of led_clock.cpp preloaded: the
/// time that a player leads, and how far the service has followed it. All zero: the time of the system.
struct LedTime {
  std::atomic<std::int32_t> is_led{0};                     ///< time stands still but for what the player adds
  std::int64_t wall_ns = 0, monotonic_ns = 0, boot_ns = 0; ///< of the system, when it was taken over
  std::atomic<std::int64_t> added_ns{0};                   ///< since then
  std::atomic<std::int64_t> offset_ns{0};                  ///< of a time that is led no more to that of the system
  std::atomic<std::uint64_t> datagrams{0}, motion{0};      ///< that the ingest of the service is done with
};

} // namespace locus::test
