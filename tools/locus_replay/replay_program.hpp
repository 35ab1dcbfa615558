// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>

#include "core/ingest/sweep.hpp"
#include "core/odometry/odometry_estimate.hpp"

namespace locus::tools {

/// What an experiment does to a sweep between its cut and the odometry, which the service does not.
using SweepStage = std::function<void(Sweep&)>;

/// What is shown each estimate as it is, sweep by sweep: the files round it and leave the twist out.
using EstimateObserver = std::function<void(const OdometryEstimate&)>;

/// The program locus-replay, from its arguments to its exit status. A stage and an observer have no place in
/// --realtime, which runs what the service runs.
int replay_program(int argc, char** argv, const SweepStage& stage = {}, const EstimateObserver& observer = {});

} // namespace locus::tools
