// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "config/config.hpp"

namespace locus::tools {

/// Configures the first lidar for the clouds of a bag without packets: for the topic with the most points, mounted as
/// /tf_static places the clouds' frame, else at the base. Reports these choices in `lines` for the user. Does nothing
/// if the bag has packets or no clouds. Throws Failure for a bag that cannot be opened.
void configure_clouds_of(const std::filesystem::path& bag_file, Config& config, std::vector<std::string>& lines);

} // namespace locus::tools
