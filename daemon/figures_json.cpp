// SPDX-License-Identifier: Apache-2.0
#include "daemon/figures_json.hpp"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <string>

namespace locus::daemon {

using nlohmann::ordered_json;

double rounded(double value) { return std::round(value * 1e4) / 1e4; }

ordered_json to_json(const PacketCounters& counters) {
  ordered_json rejected;
  for (std::size_t i = 0; i < kPacketErrorCount; ++i)
    rejected[std::string{kPacketErrorNames[i]}] = counters.rejected[i];
  return {{"received", counters.received}, {"data", counters.data},           {"position", counters.position},
          {"lost", counters.lost},         {"reordered", counters.reordered}, {"clock_steps", counters.clock_steps},
          {"rejected", rejected}};
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

ordered_json stages_json(const StageTimes& totals, std::uint64_t sweeps) {
  ordered_json stages;
  for (std::size_t i = 0; i < kStages; ++i)
    stages[std::string{kStageNames[i]}] =
        rounded(1e3 * to_seconds(totals[i]) / static_cast<double>(std::max<std::uint64_t>(1, sweeps)));
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
