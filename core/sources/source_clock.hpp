// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>

#include "core/base/stamp.hpp"

namespace locus {

/// Puts the stamps of a motion source on the host's clock.
///
/// A source whose samples arrive within a second of their stamps is taken at its word. Any other has a clock of its
/// own: its stamps are held back until a few samples in a row agree how far off it is, then that is taken out of them.
/// So a clock that steps costs a few samples, not the source. A clock that runs a little faster or slower is followed:
/// the sample of a while that took the shortest way is to have taken as long as that of the first. One owner.
class SourceClock {
 public:
  static constexpr Duration kMaxLatency = std::chrono::seconds{1};
  static constexpr Duration kMaxAhead = std::chrono::milliseconds{10}; ///< of its arrival, by rounding and jitter
  static constexpr int kSamplesToLearn = 5;
  static constexpr Duration kWindow = std::chrono::seconds{20};
  static constexpr Duration kLeastDrift = std::chrono::milliseconds{5}; ///< in the windows since the last correction
  static constexpr Duration kMostDrift = std::chrono::milliseconds{15}; ///< more is a delay

  /// The instant of the measurement; nothing while the clock is in doubt.
  std::optional<Stamp> on_host_clock(Stamp stamp, Stamp arrival);

  /// How far the source's clock is ahead of the host's.
  [[nodiscard]] Duration offset() const { return offset_; }
  /// Since the clock was first known.
  [[nodiscard]] std::uint64_t steps() const { return steps_; }

 private:
  void begin_anew(Stamp arrival, Duration latency);
  void follow_drift(Stamp arrival, Duration latency);

  bool known_ = false;
  Duration offset_{};
  Duration least_latency_{}; ///< on the present offset, of the first window
  Stamp window_began_;
  Duration least_in_window_{};
  bool first_window_ = true;
  Duration suspect_{}; ///< offset without latency, after the samples held back
  int suspects_ = 0;
  std::uint64_t steps_ = 0;
};

} // namespace locus
