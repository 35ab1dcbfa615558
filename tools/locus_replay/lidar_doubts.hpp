// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "daemon/figures.hpp"
#include "drivers/lidar_router.hpp"
#include "locus_replay/recording.hpp"

namespace locus::tools {

/// Returns why a recording held no valid data packet: what it held instead and a remedy, one line for the user.
std::string why_no_data(const Recording& recording, const LidarRouter& lidars);

/// Returns suspicious properties of the lidars of a replayed recording, a line each: one without packets though others
/// have some, one whose packets are another model's, one that rotates more slowly than sweeps end.
std::vector<std::string> lidar_warnings(const Recording& recording, const LidarRouter& lidars,
                                        const SweepOptions& sweeps);

/// Returns why no cloud was used though some were received; empty if none were received or some were used.
std::string why_no_clouds(const daemon::Figures& figures);

/// Returns a line about problems with the clouds of each lidar.
std::vector<std::string> cloud_warnings(const daemon::Figures& figures);

} // namespace locus::tools
