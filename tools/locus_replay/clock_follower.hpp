// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "core/base/stamp.hpp"

namespace locus::tools {

/// Step of the clock that stamped a recording. Steady time is that of the clock before its first step.
struct ClockStep {
  Stamp at; ///< steady time
  Duration by;
};

/// Converts the times of one series of samples to steady time, sample by sample in the order of recording.
///
/// A known step applies to a series in which the interval across it is closer to the usual one with the step than
/// without: a sensor with another clock does not step. Besides, times that go back by more than 0.1 s or ahead by more
/// than a day show a step of the series' own clock, which then continues at the usual interval, until it is set right
/// again. One owner.
class ClockFollower {
 public:
  /// Ignores own steps well before the begin of the recording: only times near it are meaningful.
  explicit ClockFollower(Stamp begin = Stamp::min()) : begin_(begin) {}

  /// Returns the steady time of the next sample; `steps` are those known by now.
  [[nodiscard]] Stamp peek(Stamp time, const std::vector<ClockStep>& steps) const {
    return resolve(time, steps).steady;
  }
  /// Same, and proceeds to the next sample.
  Stamp pass(Stamp time, const std::vector<ClockStep>& steps);

  /// Number of steps of its own clock, and the first of them.
  [[nodiscard]] std::uint64_t own_steps() const { return own_steps_; }
  [[nodiscard]] const ClockStep& first_own_step() const { return first_own_step_; }

 private:
  struct Resolved {
    Stamp steady;
    std::size_t next_step;
    std::optional<ClockStep> own_step{};
  };
  [[nodiscard]] Resolved resolve(Stamp time, const std::vector<ClockStep>& steps) const;

  Stamp begin_;
  std::optional<Stamp> last_; ///< as recorded
  Stamp last_steady_;
  Duration interval_{}; ///< usual, between samples
  std::size_t next_step_ = 0;
  Duration own_step_by_{}; ///< latest, unless undone
  std::uint64_t own_steps_ = 0;
  ClockStep first_own_step_{};
};

} // namespace locus::tools
