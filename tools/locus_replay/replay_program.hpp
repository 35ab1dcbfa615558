// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>

#include "core/ingest/sweep.hpp"
#include "core/odometry/odometry_estimate.hpp"

namespace locus::tools {

/// Hook of an experiment that modifies a sweep between its cut and the odometry; not part of the service.
using SweepStage = std::function<void(Sweep&)>;

/// Hook that receives each unrounded estimate with its twist, unlike the files.
using EstimateObserver = std::function<void(const OdometryEstimate&)>;

/// Runs locus-replay, from its arguments to its exit status. Stage and observer are not available in --realtime, which
/// runs the service's code.
int replay_program(int argc, char** argv, const SweepStage& stage = {}, const EstimateObserver& observer = {});

} // namespace locus::tools
