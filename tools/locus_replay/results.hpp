// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <limits>
#include <vector>

#include <nlohmann/json.hpp>

#include "daemon/ingest.hpp"
#include "daemon/sweep_processor.hpp"
#include "locus_replay/arguments.hpp"
#include "locus_replay/odometry_files.hpp"
#include "locus_replay/progress_bar.hpp"
#include "locus_replay/recording.hpp"
#include "locus_replay/run_figures.hpp"
#include "locus_replay/sweep_record.hpp"
#include "locus_replay/truth.hpp"

namespace locus::tools {

/// Files of a run in the output folder.
inline constexpr std::array<const char*, 5> kResultFiles{"summary.json", "odometry.tum", "odometry.csv", "map.pcd",
                                                         "report.html"};

/// Output of a run: the files in the output folder and the figures on the terminal. One owner.
class Results {
 public:
  /// Creates the folder, and removes the results of an earlier run. The arguments must outlive this. Throws Failure, as
  /// do the other methods.
  Results(const Arguments& arguments, const Config& config, const Recording& recording, Truth truth,
          const daemon::MachineTime& begin);

  void add(const daemon::ProcessedSweep& sweep);
  void add(const HealthEvent& event) { health_events_.push_back(event); }

  /// Writes the results after the last sweep. Warns of suspicious input. Fails for a recording without a valid data
  /// packet: then only summary.json is written, whose counters show the reason.
  void finish(const daemon::Ingest& ingest, const daemon::SweepProcessor& processor,
              const daemon::SweepCounters& sweeps);

 private:
  nlohmann::ordered_json write_summary(const FinishedRun& run) const;

  const Arguments& arguments_;
  const Config& config_;
  const Recording& recording_;
  daemon::MachineTime begin_;
  OdometryFiles odometry_;
  daemon::SweepStatistics tally_{std::numeric_limits<std::size_t>::max()};
  std::vector<HealthEvent> health_events_;
  std::vector<SweepRecord> sweeps_;
  Truth truth_;
  ProgressBar progress_;
};

} // namespace locus::tools
