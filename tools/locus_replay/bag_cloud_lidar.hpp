// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "config/config.hpp"

namespace locus::tools {

/// Has the first lidar take the clouds of a bag that holds no packets: of several topics the one with the most points.
/// It sits where /tf_static puts the frame of the clouds, else at the base. Says all of that in `lines` for the user.
/// Does nothing where the bag has packets, or no clouds. Throws Failure for a bag that cannot be opened.
void take_clouds_of(const std::filesystem::path& bag_file, Config& config, std::vector<std::string>& lines);

} // namespace locus::tools
