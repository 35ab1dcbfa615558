// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "locus_experiments/arguments.hpp"
#include "locus_experiments/plan.hpp"
#include "locus_experiments/recordings.hpp"
#include "locus_experiments/results.hpp"

namespace locus::experiments {

/// The drives of --simulated: in a plant, in a mine and, walking, in the plant.
std::vector<Course> drives_of_accuracy(const Arguments& arguments);

/// The programs that the page takes.
struct Programs {
  std::string replay, sim;
};

/// Replays all of it, each with all motion sources it has, with its IMU and with lidar alone, as far as these are not
/// the same, and says what came out:
///
/// {"version", "machine", "jobs", "places", "duration_s", "recordings": [{"recording", "simulation", "receiver",
/// "runs":
/// [...]}]}. "simulation": options of locus-sim, of what was simulated; "receiver": receiver_speed(). A run is
/// {"sources": names of those heard, "summary", "states", "claims", "way", "warnings"}, or {"sources", "failed"}.
/// "way": {"way_m", "percent", "deg_per_100m"} of way_drift(), where there is truth.
///
/// What cannot be replayed has a run that failed, and the others go on.
Results accuracy_of(const Arguments& arguments, const std::vector<FoundRecording>& recordings,
                    const std::vector<Course>& drives, const Programs& programs);

} // namespace locus::experiments
