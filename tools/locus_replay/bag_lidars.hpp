// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "config/config.hpp"
#include "config/config_proposal.hpp"
#include "locus_replay/bag_survey.hpp"

namespace locus::tools {

/// Configures the lidars of a bag: those of its packets, or else the clouds on the topic with the most points. Of
/// several topics of packets it uses those of the lidars that /tf_static places on the robot. Reports the choice in
/// `lines` for the user, and its reasons with the other candidates in `reasons`. Returns the frame of the first lidar;
/// empty if it is unknown. Does nothing for a bag without either.
std::string configure_lidars_of(const BagSurvey& survey, const std::filesystem::path& bag_file, Config& config,
                                std::vector<std::string>& lines, ConfigReasons& reasons);

} // namespace locus::tools
