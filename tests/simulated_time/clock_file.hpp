// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

#include "core/base/stamp.hpp"
#include "support/simulated_clock.hpp"

namespace locus::test {

/// Begins this program anew, with its clocks and those of all programs that it starts `rate` times as fast as the
/// system's, unless that is done already. Then whatever it waits for or measures is in simulated time. All of them run
/// undisturbed by other programs, where that is permitted.
void run_in_simulated_time(char** argv, double rate);

/// The simulated clock that this program has in common with those that it started. One owner.
class ClockFile {
 public:
  /// Precondition: run_in_simulated_time() was called.
  ClockFile();
  ~ClockFile();
  ClockFile(const ClockFile&) = delete;
  ClockFile& operator=(const ClockFile&) = delete;

  /// Sets the wall clock of all of them, against what it is set by now.
  void step(Duration by);
  [[nodiscard]] Duration set_by() const { return Duration{time_->set_by_ns}; }
  [[nodiscard]] double rate() const { return time_->rate; }

 private:
  void* page_ = nullptr;
  volatile SimulatedTime* time_ = nullptr; ///< the same
};

/// CLOCK_MONOTONIC of the system, whatever is preloaded.
Duration system_time();

} // namespace locus::test
