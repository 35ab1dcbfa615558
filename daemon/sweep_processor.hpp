// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>

#include "core/odometry.hpp"
#include "daemon/machine_time.hpp"
#include "daemon/stage_stopwatch.hpp"

namespace locus::daemon {

/// What became of the sweeps: seen = processed + dropped + failed, but for those that are still on their way.
struct SweepCounters {
  std::uint64_t seen = 0;      ///< built, those without a single return included
  std::uint64_t processed = 0; ///< registered
  std::uint64_t dropped = 0;   ///< a newer one was there before the odometry had time
  std::uint64_t failed = 0;    ///< not registered; the estimate is the prediction

  bool operator==(const SweepCounters&) const = default;
};

/// The estimate for one sweep, with what it took.
struct ProcessedSweep {
  OdometryEstimate estimate;
  std::uint64_t sequence = 0; ///< Sweep::sequence
  std::size_t raw_returns = 0;
  MachineTime took; ///< from the cut of the sweep to the estimate
};

/// Odometry with its costs measured; what the daemon's odometry thread and the replay in one thread share. One owner.
class SweepProcessor {
 public:
  explicit SweepProcessor(const OdometryOptions& options) : odometry_(options, &stages_) {}
  SweepProcessor(const SweepProcessor&) = delete;
  SweepProcessor& operator=(const SweepProcessor&) = delete;

  /// `cut` as Ingest::Sink has it, `stop` as Odometry has it.
  ProcessedSweep process(
      const Sweep& sweep, const MachineTime& cut, const Gicp::StopRequested& stop = [] { return false; }) {
    ProcessedSweep done{odometry_.process(sweep, stop), sweep.sequence, sweep.raw_returns, {}};
    done.took = MachineTime::now() - cut;
    return done;
  }

  [[nodiscard]] const Odometry& odometry() const { return odometry_; }
  [[nodiscard]] const StageStopwatch& stages() const { return stages_; }

 private:
  StageStopwatch stages_;
  Odometry odometry_;
};

} // namespace locus::daemon
