// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>

#include "core/sweep.hpp"

namespace locus::tools {

/// What an experiment does to a sweep between its cut and the odometry, which the service does not.
using SweepStage = std::function<void(Sweep&)>;

/// The program locus-replay, from its arguments to its exit status. A stage has no place in --realtime, which runs what
/// the service runs.
int replay_program(int argc, char** argv, const SweepStage& stage = {});

} // namespace locus::tools
