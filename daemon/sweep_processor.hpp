// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <bitset>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <vector>

#include "config/config.hpp"
#include "core/odometry/odometry.hpp"
#include "daemon/machine_time.hpp"

namespace locus::daemon {

/// Sweep counters: seen = processed + dropped + failed, except for sweeps in flight.
struct SweepCounters {
  std::uint64_t seen = 0;      ///< built, including sweeps without returns
  std::uint64_t processed = 0; ///< registered
  std::uint64_t dropped = 0;   ///< replaced by a newer one before the odometry could process it
  std::uint64_t failed = 0;    ///< not registered; the estimate is the prediction

  bool operator==(const SweepCounters&) const = default;
};

/// Initial state and map, see Odometry::begin_at().
struct StartPoint {
  ResumeState last;
  std::vector<SurfacePoint> map_odom;
};

/// Calibration of the motion sources from an earlier run, see Odometry::recall().
struct EarlierCalibration {
  LearnedSources learned{};
  double elapsed_s = 0.0;
};

/// Estimate for one sweep, with its cost.
struct ProcessedSweep {
  OdometryEstimate estimate;
  std::uint64_t sequence = 0; ///< Sweep::sequence
  std::size_t raw_returns = 0;
  std::bitset<kMaxSources> usable_sources; ///< SourcePose::usable, by source index
  MachineTime took;                        ///< from the cut of the sweep to the estimate
  StageTimes stages_took{};                ///< including the ingest and the preparation since the previous sweep
};

/// Odometry with cost measurement; shared by the daemon's odometry thread and single-threaded replay. One owner.
class SweepProcessor {
 public:
  explicit SweepProcessor(const Config& config, const std::optional<StartPoint>& start = {},
                          const EarlierCalibration& calibration = {})
      : odometry_(config.odometry, config.source_options(), &stages_) {
    odometry_.recall(calibration.learned, calibration.elapsed_s);
    if (start)
      odometry_.begin_at(start->last, start->map_odom);
  }
  SweepProcessor(const SweepProcessor&) = delete;
  SweepProcessor& operator=(const SweepProcessor&) = delete;

  /// Processes a sweep and measures its cost; `stop` as for Odometry::process().
  ProcessedSweep process(
      const Sweep& sweep, const SweepCut& cut, const Gicp::StopRequested& stop = [] { return false; }) {
    ProcessedSweep done{odometry_.process(sweep, stop), sweep.sequence, sweep.raw_returns, {}, {}, cut.ingest_took};
    done.took = MachineTime::now() - cut.start;
    const StageTimes odometry_took = stages_.lap();
    std::ranges::transform(done.stages_took, odometry_took, done.stages_took.begin(), std::plus{});
    for (std::size_t source = 0; source < kMaxSources; ++source)
      done.usable_sources[source] = sweep.motion.sources[source].usable;
    return done;
  }

  /// Prepares for the next sweep, after the estimate was published; see Odometry::prepare_next().
  void prepare_next() { odometry_.prepare_next(); }

  void set_flat_ground(FlatGround mode) { odometry_.set_flat_ground(mode); }

  [[nodiscard]] const Odometry& odometry() const { return odometry_; }
  [[nodiscard]] const StageStopwatch& stages() const { return stages_; }

 private:
  StageStopwatch stages_;
  Odometry odometry_;
};

} // namespace locus::daemon
