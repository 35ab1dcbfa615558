// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "accuracy/consistency.hpp"
#include "accuracy/map_accuracy.hpp"
#include "accuracy/trajectory_accuracy.hpp"
#include "config/config.hpp"
#include "daemon/figures_json.hpp"
#include "daemon/ingest.hpp"
#include "daemon/sweep_processor.hpp"

namespace locus::tools {

/// Gathers what is told of every sweep of a run: a few bytes for each.
class RunFigures {
 public:
  void take(const daemon::ProcessedSweep& sweep);
  void take(const HealthEvent& event) { health_events_.push_back(event); }

  [[nodiscard]] std::size_t sweeps() const { return wall_ms_.size(); }
  [[nodiscard]] daemon::Percentiles process_ms() const { return percentiles(wall_ms_); }
  [[nodiscard]] daemon::Percentiles process_cpu_ms() const { return percentiles(cpu_ms_); }
  [[nodiscard]] const daemon::SweepSums& sums() const { return sums_; }
  /// In the order in which they happened.
  [[nodiscard]] const std::vector<HealthEvent>& health_events() const { return health_events_; }
  [[nodiscard]] double path_m() const { return path_m_; }
  /// That any estimate claims.
  [[nodiscard]] double largest_speed_mps() const { return largest_speed_mps_; }
  [[nodiscard]] const Pose& last_T_odom_base() const { return last_T_odom_base_; }

 private:
  static daemon::Percentiles percentiles(std::span<const float> values);

  std::vector<float> wall_ms_, cpu_ms_;
  std::vector<HealthEvent> health_events_;
  daemon::SweepSums sums_;
  double path_m_ = 0, largest_speed_mps_ = 0;
  Pose last_T_odom_base_;
};

/// How far a run is from the truth, as far as that was given.
struct Accuracy {
  std::optional<TrajectoryAccuracy> trajectory;
  std::optional<Consistency> consistency; ///< of the covariances with that
  std::optional<MapAccuracy> map;
  std::vector<std::string> problems; ///< why one that was given could not be compared with, each a line for the user
  std::vector<std::string> warnings; ///< likewise: what makes the comparison worthless
};

/// All that a finished run is described by.
struct FinishedRun {
  std::string capture; ///< as the user named it
  const Config& config;
  const daemon::Ingest& ingest;
  const daemon::SweepProcessor& processor;
  daemon::SweepCounters sweeps;
  const RunFigures& figures;
  Stamp capture_start;       ///< which times are told from, as --fail has them
  Duration duration;         ///< of the recording
  daemon::MachineTime spent; ///< without what it took to compare with the truth
  const Accuracy& accuracy;
};

/// The contents of summary.json.
nlohmann::ordered_json summary(const FinishedRun& run);

/// The same for human eyes, in a few lines.
std::string readable(const FinishedRun& run);

} // namespace locus::tools
