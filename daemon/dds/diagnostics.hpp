// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "core/base/stamp.hpp"
#include "daemon/dds/ros_messages.hpp"
#include "daemon/figures.hpp"

namespace locus::daemon {

/// Age beyond which estimates and packets are stale.
inline constexpr Duration kStale = std::chrono::seconds{2};

/// Returns the entries of /diagnostics: one for the odometry, each lidar and each motion source, and in a service for
/// DDS and the recording, with all counters. `now` is on the clock of the stamps.
std::vector<Diagnostic> diagnostics(const Figures& figures, Stamp now);

} // namespace locus::daemon
