// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "accuracy/consistency.hpp"
#include "accuracy/map_accuracy.hpp"
#include "accuracy/trajectory_accuracy.hpp"
#include "core/sources/source_health.hpp"
#include "daemon/figures.hpp"

namespace locus::tools {

/// Accuracy of a run relative to the truth, as far as given.
struct Accuracy {
  std::optional<TrajectoryAccuracy> trajectory;
  std::optional<Consistency> consistency; ///< of the covariances with the truth
  std::optional<MapAccuracy> map;
  std::vector<std::string> problems; ///< why a given truth could not be used, each a line for the user
  std::vector<std::string> warnings; ///< why the comparison is meaningless, likewise
};

/// Data that describe a finished run.
struct FinishedRun {
  const daemon::Figures& figures;             ///< time spent excludes the comparison with the truth
  std::span<const HealthEvent> health_events; ///< in chronological order
  Stamp capture_start;                        ///< origin of times, as for --fail
  const Accuracy& accuracy;
};

/// Returns the contents of summary.json.
nlohmann::ordered_json summary(const FinishedRun& run);

/// Formats the summary for a terminal, in a few lines.
std::string readable(const FinishedRun& run);

} // namespace locus::tools
