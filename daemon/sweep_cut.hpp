// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "daemon/machine_time.hpp"
#include "daemon/stage_stopwatch.hpp"

namespace locus::daemon {

/// What goes with a sweep from where it was cut to where it is processed, to tell what it costs.
struct SweepCut {
  MachineTime began;      ///< when the work on the cut began
  StageTimes ingest_took; ///< since the cut before
};

} // namespace locus::daemon
