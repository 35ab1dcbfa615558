// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <vector>

#include "config/config.hpp"
#include "daemon/ingest.hpp"
#include "daemon/input.hpp"
#include "daemon/sweep_processor.hpp"

namespace locus::performance {

/// The complete pipeline in one thread, as in the service and locus-replay: datagrams and samples in, estimates out.
/// Not thread-safe.
class Pipeline {
 public:
  /// Ignores motion samples if the configuration has no motion sources.
  explicit Pipeline(const Config& config);
  Pipeline(const Pipeline&) = delete;
  Pipeline& operator=(const Pipeline&) = delete;

  /// Returns the sweep that this input completed, valid until the next call; nullptr if none.
  const daemon::ProcessedSweep* take(const daemon::Input& input);

  [[nodiscard]] const Odometry& odometry() const { return processor_.odometry(); }
  /// CPU time so far.
  [[nodiscard]] daemon::StageTimes stages() const;
  /// Returns the points of the last processed sweep as of its cut.
  [[nodiscard]] const std::vector<SweepPoint>& points() const { return points_; }

 private:
  void process(Sweep& sweep, const daemon::SweepCut& cut);

  bool hears_motion_;
  daemon::SweepProcessor processor_;
  std::vector<SweepPoint> points_;
  std::optional<daemon::ProcessedSweep> processed_;
  daemon::Ingest ingest_;
};

} // namespace locus::performance
