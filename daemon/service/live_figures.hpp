// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <mutex>
#include <optional>

#include "daemon/figures_json.hpp"
#include "daemon/ingest_report.hpp"
#include "daemon/sweep_processor.hpp"

namespace locus::daemon {

/// What is told of a service that runs for months: sums since its start, distributions of the last minute. Written by
/// the publisher, read by any thread; none of them on the way of an estimate.
class LiveFigures {
 public:
  static constexpr std::size_t kWindow = 600; ///< sweeps

  struct Snapshot {
    std::optional<OdometryEstimate> last;
    Duration last_at{}; ///< CLOCK_MONOTONIC when it was published
    double rate_hz = 0; ///< over the last few seconds
    SweepSums sums;
    Percentiles process_ms, process_cpu_ms;
    StageTimes stages{};
    std::uint64_t unpublished = 0; ///< that DDS did not take
    IngestReport ingest;
  };

  void take(const ProcessedSweep& sweep, bool published);
  void take(const IngestReport& report);
  [[nodiscard]] Snapshot snapshot() const;

 private:
  struct Timing {
    Duration at;
    float wall_ms, cpu_ms;
  };
  [[nodiscard]] Percentiles percentiles(float Timing::*figure) const;
  [[nodiscard]] double rate_hz() const;

  mutable std::mutex mutex_;
  Snapshot told_; ///< without percentiles and rate
  std::array<Timing, kWindow> window_{};
};

} // namespace locus::daemon
