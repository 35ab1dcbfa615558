// SPDX-License-Identifier: Apache-2.0
// The complete pipeline sweep by sweep, and the share of each stage.
#include <algorithm>
#include <string>
#include <vector>

#include "held_memory.hpp"
#include "suite.hpp"

namespace locus::performance {

namespace {

double to_ms(Duration duration) { return 1e3 * to_seconds(duration); }

/// Sums over the sweeps of a run.
struct Tally {
  std::vector<double> after_cut_ms;
  double returns = 0, points = 0, scan_to_scan = 0, scan_to_submap = 0, keyframes = 0;
  daemon::StageTimes stages{};

  void take(const daemon::ProcessedSweep& sweep) {
    after_cut_ms.push_back(to_ms(sweep.took.cpu));
    returns += static_cast<double>(sweep.raw_returns);
    points += static_cast<double>(sweep.estimate.points);
    scan_to_scan += sweep.estimate.scan_to_scan.iterations;
    scan_to_submap += sweep.estimate.scan_to_submap.iterations;
    keyframes += sweep.estimate.keyframe ? 1 : 0;
  }

  void take(const Pipeline& pipeline) {
    for (std::size_t stage = 0; stage < kStages; ++stage)
      stages[stage] += pipeline.stages()[stage];
  }

  void report(benchmark::UserCounters& counters) {
    if (after_cut_ms.empty())
      return;
    const auto sweeps = static_cast<double>(after_cut_ms.size());
    double sum_ms = 0;
    for (const double ms : after_cut_ms)
      sum_ms += ms;
    std::ranges::sort(after_cut_ms);
    const auto quantile = [&](double q) { return after_cut_ms[static_cast<std::size_t>(q * (sweeps - 1))]; };
    counters["after_cut_ms"] = sum_ms / sweeps;
    counters["after_cut_p50_ms"] = quantile(0.5);
    counters["after_cut_p99_ms"] = quantile(0.99);
    counters["returns"] = returns / sweeps;
    counters["points"] = points / sweeps;
    counters["scan_to_scan_iterations"] = scan_to_scan / sweeps;
    counters["scan_to_submap_iterations"] = scan_to_submap / sweeps;
    counters["keyframes"] = keyframes / sweeps;
    for (std::size_t stage = 0; stage < kStages; ++stage)
      counters[std::string(to_string(static_cast<Stage>(stage))) + "_ms"] = to_ms(stages[stage]) / sweeps;
  }
};

void play(benchmark::State& state, const Capture& capture, const Config& config) {
  const double before_mb = held_mb();
  Playback playback(capture, config);
  Tally tally;
  for (auto _ : state) {
    const daemon::ProcessedSweep* sweep = playback.next();
    if (sweep == nullptr) {
      state.SkipWithError("the capture is over before the iterations are");
      break;
    }
    tally.take(*sweep);
  }
  tally.take(playback.pipeline());
  tally.report(state.counters);
  state.counters["memory_mb"] = held_mb() - before_mb;
}

std::size_t sweeps_in(const Capture& capture) {
  Playback playback(capture, capture.config_of_lidar_alone());
  std::size_t sweeps = 0;
  while (playback.next() != nullptr)
    ++sweeps;
  return sweeps;
}

} // namespace

void add_pipeline(const std::string& name, const Effort& effort, const Capture& capture, const Config& config) {
  add(name, effort, sweeps_in(capture), [&capture, config](auto& state) { play(state, capture, config); });
}

void add_pipelines(const Effort& effort, const Capture& capture) {
  const std::string name = "pipeline/" + capture.name();
  add_pipeline(name + "/lidar", effort, capture, capture.config_of_lidar_alone());
  if (capture.has_motion_sources())
    add_pipeline(name + "/wheels_gyro", effort, capture, capture.config());
}

} // namespace locus::performance
