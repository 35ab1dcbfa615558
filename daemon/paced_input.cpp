// SPDX-License-Identifier: Apache-2.0
#include "daemon/paced_input.hpp"

#include <algorithm>
#include <ctime>
#include <thread>

#include "daemon/machine_time.hpp"

namespace locus::daemon {

void PacedInput::read_ahead() {
  held_ = Held{recording_.next(Duration::zero()), {}};
  held_->arrival = arrival_of(held_->input, last_arrival_);
  if (!started_ || std::chrono::abs(held_->arrival - last_arrival_) > kMaxPause) {
    anchor_arrival_ = held_->arrival;
    anchor_clock_ = read_clock(CLOCK_MONOTONIC);
    started_ = true;
  }
  last_arrival_ = held_->arrival;
}

Input PacedInput::next(Duration timeout) {
  if (!held_)
    read_ahead();
  const Duration due = anchor_clock_ + from_seconds(to_seconds(held_->arrival - anchor_arrival_) / speed_);
  const Duration remaining = due - read_clock(CLOCK_MONOTONIC);
  if (remaining > Duration::zero())
    std::this_thread::sleep_for(std::min(remaining, timeout));
  if (remaining > timeout) {
    const Duration since_anchor = read_clock(CLOCK_MONOTONIC) - anchor_clock_;
    return Silence{std::min(held_->arrival, anchor_arrival_ + from_seconds(speed_ * to_seconds(since_anchor)))};
  }
  Input input = held_->input;
  held_.reset();
  return input;
}

} // namespace locus::daemon
