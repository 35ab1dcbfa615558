// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <cstdint>

#include "core/base/stamp.hpp"

namespace locus::daemon {

/// Time as the wall clock of this host had it when the service began, and evenly from there, whoever sets that clock
/// meanwhile: a host that hears of the time of day minutes after it was booted jumps by days, and the robot does not.
/// All that the service measures is in it; what it tells is in the time on the wall. One owner, but for wall().
class SteadyTime {
 public:
  SteadyTime();

  /// Looks whether the clock was set; to be called before stamps that were made meanwhile are asked for.
  void look();

  /// Of a stamp of the wall clock that was made within the last moments, before or after the clock was set.
  [[nodiscard]] Stamp steady(Stamp wall) const;

  /// Of a stamp that its sender has put on what arrived at `arrival`: by this host's clock, or by one of its own.
  [[nodiscard]] Stamp steady(Stamp stamp, Stamp arrival) const;

  /// As the clock on the wall has it by now. Any thread.
  [[nodiscard]] Stamp wall(Stamp steady) const { return steady + Duration{set_by_ns_.load(std::memory_order_relaxed)}; }

 private:
  Duration offset_;                     ///< of the wall clock, against the time since the host was booted
  Duration set_by_{}, set_by_before_{}; ///< since the start in all, and before the last time
  std::atomic<std::int64_t> set_by_ns_{0};
};

} // namespace locus::daemon
