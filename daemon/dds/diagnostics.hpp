// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "core/base/stamp.hpp"
#include "daemon/dds/ros_messages.hpp"
#include "daemon/figures.hpp"

namespace locus::daemon {

/// Estimates and packets older than this say nothing about now.
inline constexpr Duration kStale = std::chrono::seconds{2};

/// For /diagnostics: one line for the odometry, each lidar and each motion source, and of a service for DDS and the
/// recording, with every counter in it. `now`: by the clock of the stamps.
std::vector<Diagnostic> diagnostics(const Figures& figures, Stamp now);

} // namespace locus::daemon
