// SPDX-License-Identifier: Apache-2.0
#include "core/source_clock.hpp"

#include <algorithm>
#include <chrono>

namespace locus {

namespace {

/// Offsets of samples in a row that differ by less than this agree.
constexpr Duration kAgreement = std::chrono::milliseconds{50};

bool credible(Duration latency) { return latency >= -SourceClock::kMaxAhead && latency <= SourceClock::kMaxLatency; }

} // namespace

std::optional<Stamp> SourceClock::on_host_clock(Stamp stamp, Stamp arrival) {
  const Duration latency = arrival - (stamp - offset_);
  if (credible(latency)) {
    least_latency_ = known_ ? std::min(least_latency_, latency) : latency;
    known_ = true;
    suspects_ = 0;
    return stamp - offset_;
  }
  const Duration ahead = stamp - arrival;
  const bool agrees = suspects_ > 0 && std::chrono::abs(ahead - suspect_) < kAgreement;
  suspects_ = agrees ? suspects_ + 1 : 1;
  suspect_ = agrees ? std::max(suspect_, ahead) : ahead; // the sample that took the shortest way knows best
  if (suspects_ < kSamplesToLearn)
    return std::nullopt;
  const bool at_its_word = credible(-suspect_);
  offset_ = at_its_word ? Duration::zero() : suspect_ + least_latency_;
  if (at_its_word)
    least_latency_ = -suspect_;
  steps_ += known_ ? 1 : 0;
  known_ = true;
  suspects_ = 0;
  return stamp - offset_;
}

} // namespace locus
