// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>

#include <nlohmann/json.hpp>

#include "config/config.hpp"
#include "core/sources/source_health.hpp"
#include "daemon/ingest_report.hpp"
#include "daemon/machine_time.hpp"
#include "daemon/sweep_processor.hpp"
#include "drivers/packet_counters.hpp"

/// Figures by the names that summary.json of locus-replay and the status of locusd have in common.
namespace locus::daemon {

/// Of a distribution.
struct Percentiles {
  double p50 = 0, p90 = 0, p99 = 0, max = 0;
};

/// Over the estimates of a run.
struct SweepSums {
  std::uint64_t sweeps = 0;
  double raw_points = 0, filtered_points = 0, scan_to_scan_iterations = 0, scan_to_submap_iterations = 0;
  /// Those whose prior came from the source, all of it or in part.
  std::array<std::uint64_t, kMaxSources> used_sweeps{};

  void add(const ProcessedSweep& sweep);
};

/// Four digits behind the point: no figure here is known better.
double rounded(double value);

nlohmann::ordered_json to_json(const PacketCounters& counters);
/// As what the packets of a lidar are read: model, return_mode and rpm; null before the first good one.
nlohmann::ordered_json model_json(const IngestReport::Lidar& lidar);

nlohmann::ordered_json to_json(const SweepCounters& counters);
nlohmann::ordered_json to_json(const Percentiles& percentiles);
/// `used_sweeps`: SweepSums::used_sweeps of it.
nlohmann::ordered_json to_json(const SourceCounters& counters, std::uint64_t used_sweeps);
/// In the mean over the sweeps.
nlohmann::ordered_json points_json(const SweepSums& sums);
nlohmann::ordered_json iterations_json(const SweepSums& sums);
/// Milliseconds, in the mean over `sweeps`.
nlohmann::ordered_json stages_json(const StageTimes& totals, std::uint64_t sweeps);

/// Of this process since it began, in megabytes.
double peak_rss_mb();

} // namespace locus::daemon
