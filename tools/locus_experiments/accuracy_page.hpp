// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "locus_experiments/arguments.hpp"
#include "locus_experiments/results.hpp"

namespace locus::experiments {

/// Replays all recordings in the user's folders and the simulated drives, each with all motion sources it has, with its
/// IMU and with lidar alone, where these differ, and collects the results:
///
/// {"version", "machine", "jobs", "places", "duration_s", "recordings": [{"recording", "simulation", "receiver",
/// "runs": [...]}]}. "simulation": options of locus-sim, for simulated drives; "receiver": receiver_speed(). A run is
/// recording_figures() without the receiver, or {"sources", "failed"}.
///
/// A recording that cannot be replayed has a failed run; the others continue. Throws tools::Failure if there is nothing
/// to replay.
Results accuracy_of(const Arguments& arguments);

} // namespace locus::experiments
