// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "locus_experiments/arguments.hpp"
#include "locus_experiments/results.hpp"

namespace locus::experiments {

/// Replays all recordings in the folders of the user and the simulated drives, each with all motion sources it has,
/// with its IMU and with lidar alone, as far as these are not the same, and says what came out:
///
/// {"version", "machine", "jobs", "places", "duration_s", "recordings": [{"recording", "simulation", "receiver",
/// "runs": [...]}]}. "simulation": options of locus-sim, of what was simulated; "receiver": receiver_speed(). A run is
/// what recording_figures() says but for the receiver, or {"sources", "failed"}.
///
/// What cannot be replayed has a run that failed, and the others go on. Throws tools::Failure where there is nothing to
/// replay.
Results accuracy_of(const Arguments& arguments);

} // namespace locus::experiments
