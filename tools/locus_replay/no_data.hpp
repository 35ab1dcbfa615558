// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "drivers/lidar_input.hpp"
#include "locus_replay/recording.hpp"

namespace locus::tools {

/// Why a recording held no valid data packet: what was seen in its place and what to do, one line for the user.
std::string why_no_data(const Recording& recording, const LidarRouter& lidars);

} // namespace locus::tools
