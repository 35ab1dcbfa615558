// SPDX-License-Identifier: Apache-2.0
#include "daemon/steady_time.hpp"

namespace locus::daemon {

namespace {

constexpr Duration kMaxSlew = std::chrono::milliseconds{5};     ///< largest offset change without a step
constexpr Duration kMaxReadGap = std::chrono::microseconds{20}; ///< longest gap between two simultaneous readings

} // namespace

SteadyTime::SteadyTime(Clock clock) : clock_(clock), offset_(read_offset().wall_ahead) {}

/// Reads CLOCK_REALTIME - CLOCK_BOOTTIME. Retries, since a clock step or preemption may fall between the reads.
SteadyTime::Offset SteadyTime::read_offset() const {
  constexpr int kTries = 20;
  for (int i = 1;; ++i) {
    const Duration before = clock_(CLOCK_BOOTTIME);
    const Duration wall = clock_(CLOCK_REALTIME);
    if (const Duration after = clock_(CLOCK_BOOTTIME); after - before < kMaxReadGap || i == kTries)
      return {after, wall - after};
  }
}

Stamp SteadyTime::now() const { return Stamp{clock_(CLOCK_BOOTTIME) + offset_ - steps_}; }

void SteadyTime::detect_step() {
  const auto [boot, wall_ahead] = read_offset();
  const Duration change = wall_ahead - offset_;
  if (std::chrono::abs(change) < kMaxSlew)
    return;
  stepped_at_ = Stamp{boot + offset_ - steps_};
  offset_ += change;
  steps_before_last_ = steps_;
  steps_ += change;
  steps_ns_.store(steps_.count(), std::memory_order_relaxed);
}

/// Tells stamps from before the last step by their time under the current offset: they lie before the step if the clock
/// was set forward (a step is detected shortly after it), and in the future if it was set back.
Stamp SteadyTime::to_steady(Stamp wall) const {
  const Stamp after = wall - steps_, before = wall - steps_before_last_;
  if (steps_ == steps_before_last_ || now() - stepped_at_ > kMaxTransit)
    return after;
  const Stamp latest = now() + kMaxSlew;
  const bool is_forward = steps_ > steps_before_last_;
  return (is_forward && after < stepped_at_ && before < latest) || after > latest ? before : after;
}

Stamp SteadyTime::to_steady(Stamp stamp, Stamp arrival, Sender& sender) const {
  Stamp steady = stamp - sender.shift;
  if (const Duration new_steps = steps_ - sender.steps; new_steps != Duration::zero()) {
    const auto lag_change = [&](Stamp read) { return std::chrono::abs(arrival - read - sender.lag); };
    const bool is_host = lag_change(steady - new_steps) < lag_change(steady);
    steady -= is_host ? new_steps : Duration::zero();
    if (now() - stepped_at_ > kMaxTransit) { // until then, stamps from before the step may be in transit
      sender.shift += is_host ? new_steps : Duration::zero();
      sender.steps = steps_;
    }
  }
  sender.lag = arrival - steady;
  return steady;
}

} // namespace locus::daemon
