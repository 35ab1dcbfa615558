// SPDX-License-Identifier: Apache-2.0
#include "daemon/steady_time.hpp"

namespace locus::daemon {

namespace {

constexpr Duration kSlew = std::chrono::milliseconds{5};         ///< largest offset change without a step
constexpr Duration kUndisturbed = std::chrono::microseconds{20}; ///< longest gap between two simultaneous readings

} // namespace

SteadyTime::SteadyTime(Clock clock) : clock_(clock), offset_(read_offset().wall_ahead) {}

/// Reads CLOCK_REALTIME - CLOCK_BOOTTIME. Retries, since a clock step or preemption may fall between the reads.
SteadyTime::Offset SteadyTime::read_offset() const {
  constexpr int kTries = 20;
  for (int i = 1;; ++i) {
    const Duration before = clock_(CLOCK_BOOTTIME);
    const Duration wall = clock_(CLOCK_REALTIME);
    if (const Duration after = clock_(CLOCK_BOOTTIME); after - before < kUndisturbed || i == kTries)
      return {after, wall - after};
  }
}

Stamp SteadyTime::now() const { return Stamp{clock_(CLOCK_BOOTTIME) + offset_ - set_by_}; }

void SteadyTime::look() {
  const auto [boot, wall_ahead] = read_offset();
  const Duration change = wall_ahead - offset_;
  if (std::chrono::abs(change) < kSlew)
    return;
  set_at_ = Stamp{boot + offset_ - set_by_};
  offset_ += change;
  set_by_before_ = set_by_;
  set_by_ += change;
  set_by_ns_.store(set_by_.count(), std::memory_order_relaxed);
}

/// Tells stamps from before the last step by their time under the current offset: they lie before the step if the clock
/// was set forward (a step is detected shortly after it), and in the future if it was set back.
Stamp SteadyTime::steady(Stamp wall) const {
  const Stamp after = wall - set_by_, before = wall - set_by_before_;
  if (set_by_ == set_by_before_ || now() - set_at_ > kOnItsWay)
    return after;
  const Stamp latest = now() + kSlew;
  const bool is_forward = set_by_ > set_by_before_;
  return (is_forward && after < set_at_ && before < latest) || after > latest ? before : after;
}

Stamp SteadyTime::steady(Stamp stamp, Stamp arrival, Sender& sender) const {
  Stamp steady = stamp - sender.shift;
  if (const Duration news = set_by_ - sender.set_by; news != Duration::zero()) {
    const auto unlike = [&](Stamp read) { return std::chrono::abs(arrival - read - sender.lag); };
    const bool is_host = unlike(steady - news) < unlike(steady);
    steady -= is_host ? news : Duration::zero();
    if (now() - set_at_ > kOnItsWay) { // until then, stamps from before the step may be in transit
      sender.shift += is_host ? news : Duration::zero();
      sender.set_by = set_by_;
    }
  }
  sender.lag = arrival - steady;
  return steady;
}

} // namespace locus::daemon
