// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <cstdint>
#include <ctime>

#include "core/base/stamp.hpp"
#include "daemon/machine_time.hpp"

namespace locus::daemon {

/// Monotonic time on the wall-clock epoch of start-up (CLOCK_BOOTTIME + constant). Unaffected by clock steps such as
/// the first NTP fix, which may come minutes after boot and amount to days. Used internally for all measurements;
/// outputs are converted to wall time. One owner, except for to_wall() and steps().
class SteadyTime {
 public:
  /// Longest transit of a stamp: from the clock that made it to here, on a machine that is busy.
  static constexpr Duration kMaxTransit = std::chrono::seconds{2};

  using Clock = Duration (*)(clockid_t); ///< read_clock(), replaceable in tests
  explicit SteadyTime(Clock clock = [](clockid_t id) { return read_clock(id); });

  /// Detects a step of the wall clock. To be called after stamps are obtained and before they are converted.
  void detect_step();

  /// Converts a recent wall-clock stamp, made before or after the last step.
  [[nodiscard]] Stamp to_steady(Stamp wall) const;

  /// State of a publisher that stamps its own samples: with this host's clock, or with an independent clock that a step
  /// does not affect.
  struct Sender {
    Duration shift{}; ///< correction subtracted from its stamps
    Duration lag{};   ///< arrival minus converted stamp of its last sample
    Duration steps{}; ///< total clock steps accounted for in `shift`
  };
  /// Converts the stamp of a sample that arrived at `arrival`. The lag identifies the clock: a step leaves it unchanged
  /// if it is attributed to the right clock.
  [[nodiscard]] Stamp to_steady(Stamp stamp, Stamp arrival, Sender& sender) const;

  /// Converts steady time to the current wall clock. Any thread.
  [[nodiscard]] Stamp to_wall(Stamp steady) const { return steady + steps(); }
  /// Returns the sum of all wall-clock steps since the start. Any thread.
  [[nodiscard]] Duration steps() const { return Duration{steps_ns_.load(std::memory_order_relaxed)}; }

 private:
  struct Offset {
    Duration boot, wall_ahead;
  };
  [[nodiscard]] Offset read_offset() const;
  [[nodiscard]] Stamp now() const;

  Clock clock_;
  Duration offset_;                        ///< CLOCK_REALTIME - CLOCK_BOOTTIME
  Duration steps_{}, steps_before_last_{}; ///< sum of all steps since the start, including and excluding the last
  Stamp stepped_at_;                       ///< detection of the last step, steady time
  std::atomic<std::int64_t> steps_ns_{0};
};

} // namespace locus::daemon
