// SPDX-License-Identifier: Apache-2.0
#include "core/sources/source_clock.hpp"

#include <algorithm>
#include <chrono>

namespace locus {

namespace {

/// Largest difference between the offsets of consecutive samples that agree.
constexpr Duration kAgreement = std::chrono::milliseconds{50};

bool credible(Duration latency) { return latency >= -SourceClock::kMaxAhead && latency <= SourceClock::kMaxLatency; }

} // namespace

std::optional<Stamp> SourceClock::on_host_clock(Stamp stamp, Stamp arrival) {
  const Duration latency = arrival - (stamp - offset_);
  if (credible(latency)) {
    if (!known_)
      restart(arrival, latency);
    follow_drift(arrival, latency);
    known_ = true;
    suspects_ = 0;
    return stamp - offset_;
  }
  const Duration ahead = stamp - arrival;
  const bool agrees = suspects_ > 0 && std::chrono::abs(ahead - suspect_) < kAgreement;
  suspects_ = agrees ? suspects_ + 1 : 1;
  suspect_ = agrees ? std::max(suspect_, ahead) : ahead; // the sample with the least latency is the best
  if (suspects_ < kSamplesToLearn)
    return std::nullopt;
  const bool is_on_host_clock = credible(-suspect_);
  offset_ = is_on_host_clock ? Duration::zero() : suspect_ + least_latency_;
  const Duration shortest = offset_ - suspect_;
  if (!known_ || is_on_host_clock)
    restart(arrival, shortest);
  window_began_ = arrival;
  least_in_window_ = shortest;
  steps_ += known_ ? 1 : 0;
  known_ = true;
  suspects_ = 0;
  return stamp - offset_;
}

/// Restarts the drift estimation: the first window determines the usual latency.
void SourceClock::restart(Stamp arrival, Duration latency) {
  window_began_ = arrival;
  least_latency_ = least_in_window_ = latency;
  first_window_ = true;
}

void SourceClock::follow_drift(Stamp arrival, Duration latency) {
  least_in_window_ = std::min(least_in_window_, latency);
  if (first_window_)
    least_latency_ = least_in_window_;
  if (std::chrono::abs(arrival - window_began_) < kWindow)
    return;
  const Duration drift = least_in_window_ - least_latency_;
  const bool is_drift = std::chrono::abs(drift) >= kLeastDrift && std::chrono::abs(drift) <= kMostDrift;
  if (is_drift)
    offset_ -= drift;
  window_began_ = arrival;
  least_in_window_ = is_drift ? latency - drift : latency;
  first_window_ = false;
}

} // namespace locus
