// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <cstdint>
#include <ctime>

#include "core/base/stamp.hpp"
#include "daemon/machine_time.hpp"

namespace locus::daemon {

/// Time as the wall clock of this host had it when the service began, and evenly from there, whoever sets that clock
/// meanwhile: a host that hears of the time of day minutes after it was booted jumps by days, and the robot does not.
/// All that the service measures is in it; what it tells is in the time on the wall. One owner, but for wall().
class SteadyTime {
 public:
  using Clock = Duration (*)(clockid_t); ///< read_clock(), or another in tests
  explicit SteadyTime(Clock clock = [](clockid_t id) { return read_clock(id); });

  /// Looks whether the clock was set: after stamps were obtained, and before they are converted.
  void look();

  /// Of a stamp of the wall clock that was made within the last moments, before or after the clock was set.
  [[nodiscard]] Stamp steady(Stamp wall) const;

  /// What is known of who stamps its samples itself: whether by the clock of this host, or by one of its own that
  /// nobody has set.
  struct Sender {
    Duration shift{};  ///< of its stamps to steady time
    Duration lag{};    ///< of its last sample, from stamp to arrival
    Duration set_by{}; ///< of the host's clock, as far as `shift` knows
  };
  /// Of the stamp of a sample that came at `arrival`. Whose clock it is shows in the lag, which no clock that is set
  /// changes.
  [[nodiscard]] Stamp steady(Stamp stamp, Stamp arrival, Sender& sender) const;

  /// As the clock on the wall has it by now. Any thread.
  [[nodiscard]] Stamp wall(Stamp steady) const { return steady + set_by(); }
  /// Since the start in all. Any thread.
  [[nodiscard]] Duration set_by() const { return Duration{set_by_ns_.load(std::memory_order_relaxed)}; }

 private:
  struct Offset {
    Duration boot, wall_ahead;
  };
  [[nodiscard]] Offset read_offset() const;
  [[nodiscard]] Stamp now() const;

  Clock clock_;
  Duration offset_;                     ///< of the wall clock, against the time since the host was booted
  Duration set_by_{}, set_by_before_{}; ///< since the start in all, and before the last time
  Stamp set_at_;                        ///< that was the last time
  std::atomic<std::int64_t> set_by_ns_{0};
};

} // namespace locus::daemon
