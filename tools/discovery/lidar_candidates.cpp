// SPDX-License-Identifier: Apache-2.0
#include "discovery/lidar_candidates.hpp"

#include <algorithm>
#include <map>

#include <fmt/format.h>

namespace locus::tools {

std::string text_of(const SurveyedLidar& lidar) {
  std::string text = lidar.name();
  if (lidar.beams > 0)
    text += fmt::format(", {} beams", lidar.beams);
  if (!lidar.return_mode.empty())
    text += fmt::format(", {} returns", lidar.return_mode);
  if (lidar.rotation_rate_rpm > 0)
    text += fmt::format(", {:.0f} rpm", lidar.rotation_rate_rpm);
  return text + ", " + lidar.clock_state();
}

std::vector<LidarCandidate> lidar_candidates(const LidarSurvey& survey, std::uint16_t port) {
  std::vector<LidarCandidate> candidates;
  std::map<std::uint16_t, int> on_port;
  for (const SurveyedLidar& lidar : survey.lidars()) {
    if (!lidar.is_known())
      continue;
    LidarCandidate& one = candidates.emplace_back(LidarCandidate{lidar, {}});
    one.options.port = lidar.port;
    one.options.ouster = lidar.ouster.has_value();
    ++on_port[lidar.port];
  }
  for (LidarCandidate& one : candidates)
    if (on_port[one.found.port] > 1)
      one.options.source_ip = one.found.ip;
  std::stable_partition(candidates.begin(), candidates.end(),
                        [&](const LidarCandidate& one) { return one.found.port == port; });
  return candidates;
}

} // namespace locus::tools
