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
  const daemon::Figures& figures;             ///< the time spent is without what it took to compare with the truth
  std::span<const HealthEvent> health_events; ///< in the order in which they happened
  Stamp capture_start;                        ///< which times are told from, as --fail has them
  const Accuracy& accuracy;
};

/// The contents of summary.json.
nlohmann::ordered_json summary(const FinishedRun& run);

/// The same for human eyes, in a few lines.
std::string readable(const FinishedRun& run);

} // namespace locus::tools
