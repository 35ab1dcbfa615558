// SPDX-License-Identifier: Apache-2.0
#include "locus_replay/capture_lidars.hpp"

#include <algorithm>
#include <cstddef>

#include <fmt/format.h>

#include "discovery/lidar_candidates.hpp"
#include "unpacking/unpacking_stream.hpp"

namespace locus::tools {
namespace {

LidarSurvey survey_of(const std::filesystem::path& file) {
  constexpr int kLookedAt = 2000; ///< packets; a second or two of each of several lidars
  LidarSurvey survey;
  auto capture = open_capture(file); // an unreadable one is reported when it is opened for playing
  for (int looked_at = 0; capture && looked_at < kLookedAt; ++looked_at) {
    const Datagram* const datagram = capture->next();
    if (datagram == nullptr)
      break;
    survey.add(*datagram);
  }
  return survey;
}

} // namespace

void configure_lidar_of_capture(const std::filesystem::path& file, Config& config, std::vector<std::string>& lines,
                                ConfigReasons& reasons) {
  std::error_code ignored;
  if (!std::filesystem::is_regular_file(file, ignored))
    return;
  LidarOptions& lidar = config.lidars.front();
  std::vector<LidarCandidate> candidates = lidar_candidates(survey_of(file), lidar.port);
  std::stable_partition(candidates.begin(), candidates.end(),
                        [&](const LidarCandidate& one) { return !one.options.ouster; });
  if (candidates.empty())
    return;
  const LidarCandidate& chosen = candidates.front();
  if (!chosen.options.ouster) {
    if (chosen.options.port != lidar.port)
      lines.push_back(fmt::format("{}: lidar {} is {}, which sends to port {}", file.string(), lidar.name,
                                  chosen.found.name(), chosen.options.port));
    lidar.port = chosen.options.port;
    reasons.of_key["lidars.0.port"] = text_of(chosen.found);
  }
  for (std::size_t i = 1; i < candidates.size(); ++i) {
    LidarOptions other = candidates[i].options;
    other.name = fmt::format("lidar{}", i + 1);
    reasons.other_lidars.push_back(
        {other, fmt::format("{}; the capture does not show where it is mounted: measure and add T_base_lidar{}",
                            text_of(candidates[i].found), other.ouster ? ", and its metadata" : "")});
  }
}

} // namespace locus::tools
