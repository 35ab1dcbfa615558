// SPDX-License-Identifier: Apache-2.0
#include "daemon/figures_json.hpp"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <string>

namespace locus::daemon {

using nlohmann::ordered_json;

namespace {

double mean(double sum, std::uint64_t sweeps) {
  return rounded(sum / static_cast<double>(std::max<std::uint64_t>(1, sweeps)));
}

} // namespace

void SweepSums::add(const ProcessedSweep& sweep) {
  const OdometryEstimate& estimate = sweep.estimate;
  ++sweeps;
  raw_points += static_cast<double>(sweep.raw_returns);
  filtered_points += static_cast<double>(estimate.points);
  scan_to_scan_iterations += estimate.scan_to_scan.iterations;
  scan_to_submap_iterations += estimate.scan_to_submap.iterations;
  const PriorSource& prior = estimate.prior;
  if (prior.rotation)
    ++used_sweeps[index_of(*prior.rotation)];
  if (prior.translation && prior.translation != prior.rotation)
    ++used_sweeps[index_of(*prior.translation)];
}

double rounded(double value) { return std::round(value * 1e4) / 1e4; }

ordered_json to_json(const PacketCounters& counters) {
  ordered_json rejected;
  for (std::size_t i = 0; i < kPacketErrorCount; ++i)
    rejected[std::string{kPacketErrorNames[i]}] = counters.rejected[i];
  return {{"received", counters.received}, {"data", counters.data},           {"position", counters.position},
          {"lost", counters.lost},         {"reordered", counters.reordered}, {"clock_steps", counters.clock_steps},
          {"rejected", rejected}};
}

ordered_json model_json(const IngestReport::Lidar& lidar) {
  const auto name_or_null = [](const auto& value) {
    return value ? ordered_json(std::string{velodyne::to_string(*value)}) : ordered_json(nullptr);
  };
  return {{"model", name_or_null(lidar.model)},
          {"return_mode", name_or_null(lidar.return_mode)},
          {"rpm", rounded(lidar.rotation_rate_rpm)}};
}

ordered_json to_json(const SweepCounters& counters) {
  return {{"seen", counters.seen},
          {"processed", counters.processed},
          {"dropped", counters.dropped},
          {"failed", counters.failed}};
}

ordered_json to_json(const Percentiles& p) {
  return {{"p50", rounded(p.p50)}, {"p90", rounded(p.p90)}, {"p99", rounded(p.p99)}, {"max", rounded(p.max)}};
}

ordered_json to_json(const SourceCounters& counters, std::uint64_t used_sweeps) {
  constexpr std::size_t kAlwaysTold = 7; ///< reasons; the others are rare, and told where they occur
  ordered_json rejected;
  for (std::size_t reason = 0; reason < kHealthReasonCount; ++reason) {
    if (reason < kAlwaysTold || counters.rejected[reason] > 0)
      rejected[std::string{kHealthReasonNames[reason]}] = counters.rejected[reason];
  }
  return {{"received", counters.received},
          {"used_sweeps", used_sweeps},
          {"rejected", rejected},
          {"health_changes", counters.health_changes}};
}

ordered_json points_json(const SweepSums& sums) {
  return {{"raw_mean", mean(sums.raw_points, sums.sweeps)}, {"filtered_mean", mean(sums.filtered_points, sums.sweeps)}};
}

ordered_json iterations_json(const SweepSums& sums) {
  return {{"scan_to_scan", mean(sums.scan_to_scan_iterations, sums.sweeps)},
          {"scan_to_submap", mean(sums.scan_to_submap_iterations, sums.sweeps)}};
}

ordered_json stages_json(const StageTimes& totals, std::uint64_t sweeps) {
  ordered_json stages;
  for (std::size_t i = 0; i < kStages; ++i)
    stages[std::string{kStageNames[i]}] = mean(1e3 * to_seconds(totals[i]), sweeps);
  return stages;
}

/// Not from getrusage(): its figure survives exec, so it may be that of the program that started this one.
double peak_rss_mb() {
  std::ifstream status{"/proc/self/status"};
  for (std::string word; status >> word;) {
    if (double kib = 0; word == "VmHWM:" && status >> kib)
      return kib * 1024.0 / 1e6;
  }
  return 0.0;
}

} // namespace locus::daemon
