// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>

#include "core/base/stamp.hpp"

namespace locus {

/// Converts the stamps of a motion source to the host's clock.
///
/// Stamps of a source whose samples arrive within a second of them are accepted unchanged. Any other source has a clock
/// of its own: its samples are dropped until a few consecutive ones agree on its offset, which is then removed. So a
/// clock step costs a few samples, not the source. Drift is compensated: the least latency of each window is assumed to
/// equal that of the first window. One owner.
class SourceClock {
 public:
  static constexpr Duration kMaxLatency = std::chrono::seconds{1};
  static constexpr Duration kMaxAhead = std::chrono::milliseconds{10}; ///< of the arrival, by rounding and jitter
  static constexpr int kSamplesToLearn = 5;
  static constexpr Duration kWindow = std::chrono::seconds{20};
  static constexpr Duration kLeastDrift = std::chrono::milliseconds{5}; ///< smaller drift accumulates over windows
  static constexpr Duration kMostDrift = std::chrono::milliseconds{15}; ///< more is a delay, not drift

  /// Returns the instant of the measurement; nothing while the offset is uncertain.
  std::optional<Stamp> on_host_clock(Stamp stamp, Stamp arrival);

  /// Returns how far the source's clock is ahead of the host's.
  [[nodiscard]] Duration offset() const { return offset_; }
  /// Returns the number of clock steps since the offset was first known.
  [[nodiscard]] std::uint64_t steps() const { return steps_; }

 private:
  void restart(Stamp arrival, Duration latency);
  void follow_drift(Stamp arrival, Duration latency);

  bool known_ = false;
  Duration offset_{};
  Duration least_latency_{}; ///< with the present offset, in the first window
  Stamp window_began_;
  Duration least_in_window_{};
  bool first_window_ = true;
  Duration suspect_{}; ///< offset without latency, from the dropped samples
  int suspects_ = 0;
  std::uint64_t steps_ = 0;
};

} // namespace locus
