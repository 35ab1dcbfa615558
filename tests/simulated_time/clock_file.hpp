// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

#include "core/base/stamp.hpp"
#include "support/simulated_clock.hpp"

namespace locus::test {

/// Restarts this program with its clocks, and those of all programs that it starts, `rate` times as fast as the
/// system's, unless that is the case already. All its waits and measurements are then in simulated time. The programs
/// run at real-time priority, if permitted.
void run_in_simulated_time(char** argv, double rate);

/// The simulated clock that this program shares with its child processes. Not thread-safe.
class ClockFile {
 public:
  /// Precondition: run_in_simulated_time() was called.
  ClockFile();
  ~ClockFile();
  ClockFile(const ClockFile&) = delete;
  ClockFile& operator=(const ClockFile&) = delete;

  /// Steps the wall clock of all these programs, relative to its present offset.
  void step(Duration by);
  [[nodiscard]] Duration set_by() const { return Duration{time_->set_by_ns}; }
  [[nodiscard]] double rate() const { return time_->rate; }

 private:
  void* page_ = nullptr;
  volatile SimulatedTime* time_ = nullptr; ///< same address as page_
};

/// Returns the system's CLOCK_MONOTONIC, even if the simulated clock is preloaded.
Duration system_time();

} // namespace locus::test
