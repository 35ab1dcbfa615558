// SPDX-License-Identifier: Apache-2.0
#include "daemon/service/live_figures.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

namespace locus::daemon {

void LiveFigures::take(const ProcessedSweep& sweep, bool published) {
  const std::scoped_lock lock(mutex_);
  const Duration now = read_clock(CLOCK_MONOTONIC);
  window_[told_.sums.sweeps % kWindow] = {now, static_cast<float>(1e3 * to_seconds(sweep.took.wall)),
                                          static_cast<float>(1e3 * to_seconds(sweep.took.cpu))};
  told_.sums.add(sweep);
  told_.last = sweep.estimate;
  told_.last_at = now;
  for (std::size_t i = 0; i < kStages; ++i)
    told_.stages[i] += sweep.stages_took[i];
  told_.unpublished += published ? 0 : 1;
}

void LiveFigures::take(const IngestReport& report) {
  const std::scoped_lock lock(mutex_);
  told_.ingest = report;
}

LiveFigures::Snapshot LiveFigures::snapshot() const {
  const std::scoped_lock lock(mutex_);
  Snapshot snapshot = told_;
  snapshot.process_ms = percentiles(&Timing::wall_ms);
  snapshot.process_cpu_ms = percentiles(&Timing::cpu_ms);
  snapshot.rate_hz = rate_hz();
  return snapshot;
}

Percentiles LiveFigures::percentiles(float Timing::*figure) const {
  std::vector<float> values;
  for (std::size_t i = 0; i < std::min<std::size_t>(told_.sums.sweeps, kWindow); ++i)
    values.push_back(window_[i].*figure);
  if (values.empty())
    return {};
  std::ranges::sort(values);
  const auto at = [&](double share) {
    return static_cast<double>(
        values[static_cast<std::size_t>(std::lround(share * static_cast<double>(values.size() - 1)))]);
  };
  return {at(0.5), at(0.9), at(0.99), at(1.0)};
}

/// Of the estimates younger than a few seconds: one that has stopped has a rate of zero.
double LiveFigures::rate_hz() const {
  constexpr Duration kSpan = std::chrono::seconds{5};
  const Duration now = read_clock(CLOCK_MONOTONIC);
  const std::size_t known = std::min<std::size_t>(told_.sums.sweeps, kWindow);
  std::size_t young = 0;
  Duration oldest = now;
  for (; young < known; ++young) {
    const Timing& timing = window_[(told_.sums.sweeps - 1 - young) % kWindow];
    if (now - timing.at > kSpan)
      break;
    oldest = timing.at;
  }
  const double elapsed_s = to_seconds(now - oldest);
  return young > 1 && elapsed_s > 0 ? static_cast<double>(young - 1) / elapsed_s : 0.0;
}

} // namespace locus::daemon
