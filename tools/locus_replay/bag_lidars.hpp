// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "config/config.hpp"
#include "locus_replay/bag_survey.hpp"

namespace locus::tools {

/// Configures the first lidar for the clouds of a bag without packets: for the topic with the most points. Reports the
/// choice in `lines` for the user. Does nothing if the bag has packets or no clouds.
void configure_clouds_of(const BagSurvey& survey, const std::filesystem::path& bag_file, Config& config,
                         std::vector<std::string>& lines);

} // namespace locus::tools
