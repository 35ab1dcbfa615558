// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <utility>

#include "config/config.hpp"
#include "daemon/ingest.hpp"
#include "daemon/input.hpp"
#include "daemon/sweep_processor.hpp"

namespace locus::daemon {

/// Ingest and odometry in the caller's thread: process() returns once the sweeps completed by the input are processed.
/// Shared by locus-replay and liblocus; the service runs the same objects in separate threads (LivePipeline). The same
/// inputs give the same bits. One owner.
class InlinePipeline {
 public:
  /// Changes a sweep between its cut and the odometry; for experiments.
  using Stage = std::function<void(Sweep& sweep)>;
  /// Receives each sweep after processing; may query the pipeline.
  using Sink = std::function<void(const Sweep& sweep, const ProcessedSweep& done)>;

  /// Takes `lidars` opened from config.lidars.
  InlinePipeline(const Config& config, LidarRouter lidars, Sink sink, MotionSources::HealthSink health_sink = {},
                 Stage stage = {})
      : stage_(std::move(stage)), sink_(std::move(sink)), processor_(config),
        ingest_(
            config, std::move(lidars), [this](Sweep& sweep, const SweepCut& cut) { process_sweep(sweep, cut); },
            std::move(health_sink)) {}
  InlinePipeline(const InlinePipeline&) = delete;
  InlinePipeline& operator=(const InlinePipeline&) = delete;

  void process(const Input& input) { ingest_.process(input); }

  [[nodiscard]] const Ingest& ingest() const { return ingest_; }
  [[nodiscard]] const SweepProcessor& processor() const { return processor_; }
  [[nodiscard]] const SweepCounters& counters() const { return counters_; }

 private:
  void process_sweep(Sweep& sweep, const SweepCut& cut) {
    if (stage_)
      stage_(sweep);
    const ProcessedSweep done = processor_.process(sweep, cut);
    processor_.prepare_next();
    ingest_.apply(processor_.odometry().feedback());
    ++counters_.seen;
    ++(done.estimate.failed ? counters_.failed : counters_.processed);
    sink_(sweep, done);
  }

  Stage stage_;
  Sink sink_;
  SweepCounters counters_;
  SweepProcessor processor_;
  Ingest ingest_;
};

} // namespace locus::daemon
