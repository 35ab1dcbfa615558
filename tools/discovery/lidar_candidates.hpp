// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "config/config.hpp"
#include "drivers/lidar_survey.hpp"

namespace locus::tools {

/// Describes a lidar for a comment: "VLP-16 at 192.168.1.201, strongest returns, 600 rpm, PPS locked".
std::string text_of(const SurveyedLidar& lidar);

/// Lidar that a configuration can name.
struct LidarCandidate {
  SurveyedLidar found;
  LidarOptions options; ///< port, and the address if another lidar sends to the same port; no name yet
};

/// Returns the lidars whose packets can be read, those of `port` first.
std::vector<LidarCandidate> lidar_candidates(const LidarSurvey& survey, std::uint16_t port);

} // namespace locus::tools
