// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "daemon/figures.hpp"
#include "drivers/lidar_input.hpp"
#include "locus_replay/recording.hpp"

namespace locus::tools {

/// Why a recording held no valid data packet: what was seen in its place and what to do, one line for the user.
std::string why_no_data(const Recording& recording, const LidarRouter& lidars);

/// What about the lidars of a recording that was played is unlikely to be what the user meant, a line each: one that
/// was not heard though others were, one whose packets are another model's, one that turns more slowly than sweeps end.
std::vector<std::string> lidar_warnings(const Recording& recording, const LidarRouter& lidars,
                                        const SweepOptions& sweeps);

/// Why no cloud was used though some came; empty where none came, or some were used.
std::string why_no_clouds(const daemon::Figures& figures);

/// What is wrong with the clouds of each lidar, a line each.
std::vector<std::string> cloud_warnings(const daemon::Figures& figures);

} // namespace locus::tools
