// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "config/config.hpp"
#include "config/config_proposal.hpp"
#include "locus_replay/bag_survey.hpp"

namespace locus::tools {

/// Configures the topics of the motion sources of a bag (choose_sources()), and the frame of the base: if /tf_static
/// does not connect the usual one with the lidar, the body whose motion the odometry reports.
void configure_sources_of(const BagSurvey& survey, const std::string& lidar_frame, Config& config,
                          ConfigReasons& reasons);

} // namespace locus::tools
