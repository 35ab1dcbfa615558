// SPDX-License-Identifier: Apache-2.0
#include "daemon/steady_time.hpp"

#include <algorithm>
#include <array>
#include <ctime>
#include <initializer_list>

#include "daemon/machine_time.hpp"

namespace locus::daemon {

namespace {

constexpr Duration kSlew = std::chrono::milliseconds{5};  ///< two readings of clocks that nobody has set agree to it
constexpr Duration kSameClock = std::chrono::seconds{10}; ///< no sender's stamp is older
constexpr Duration kInterrupted = std::chrono::milliseconds{1}; ///< readings so far apart do not belong together

Stamp nearest(std::initializer_list<Stamp> stamps, Stamp to) {
  return std::min(stamps, [to](Stamp a, Stamp b) { return std::chrono::abs(a - to) < std::chrono::abs(b - to); });
}

} // namespace

SteadyTime::SteadyTime() : offset_(read_clock(CLOCK_REALTIME) - read_clock(CLOCK_BOOTTIME)) {}

void SteadyTime::look() {
  const Duration before = read_clock(CLOCK_BOOTTIME), wall = read_clock(CLOCK_REALTIME);
  if (read_clock(CLOCK_BOOTTIME) - before > kInterrupted)
    return;
  const Duration change = wall - before - offset_;
  if (std::chrono::abs(change) < kSlew)
    return;
  offset_ += change;
  set_by_before_ = set_by_;
  set_by_ += change;
  set_by_ns_.store(set_by_.count(), std::memory_order_relaxed);
}

Stamp SteadyTime::steady(Stamp wall) const {
  if (set_by_ == set_by_before_)
    return wall;
  const Stamp now{read_clock(CLOCK_BOOTTIME) + offset_ - set_by_};
  return nearest({wall - set_by_, wall - set_by_before_}, now);
}

Stamp SteadyTime::steady(Stamp stamp, Stamp arrival) const {
  if (set_by_ == set_by_before_)
    return stamp;
  const Stamp by_host = nearest({stamp, stamp - set_by_, stamp - set_by_before_}, arrival);
  return std::chrono::abs(by_host - arrival) < kSameClock ? by_host : stamp;
}

} // namespace locus::daemon
