// SPDX-License-Identifier: Apache-2.0
#include "locus_replay/bag_sources.hpp"

#include <algorithm>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "locus_replay/bag_topics.hpp"

namespace locus::tools {
namespace {

/// Returns the frame of the body whose motion the configured odometry reports, without the slash of older tf.
std::string body_of_odometry(const std::vector<MotionCandidate>& candidates, const Config& config) {
  for (const MotionCandidate& one : candidates) {
    const bool is_used =
        std::ranges::find(config.motion_sources, one.topic, &MotionSource::topic) != config.motion_sources.end();
    if (one.kind == SourceKind::odometry && is_used)
      return one.frame.substr(one.frame.starts_with('/') ? 1 : 0);
  }
  return "";
}

} // namespace

void configure_sources_of(const BagSurvey& survey, const std::string& lidar_frame, Config& config,
                          ConfigReasons& reasons) {
  const auto is_connected = [&](const std::string& a, const std::string& b) {
    return !a.empty() && !b.empty() && survey.transforms.between(a, b).has_value();
  };
  std::vector<MotionCandidate> candidates;
  for (const auto& [index, topic] : survey.topics)
    if (topic.motion && !are_results(survey.bag->topics()[index], config))
      candidates.push_back(*topic.motion);
  const auto is_placed = [&](const std::string& frame) {
    return is_connected(config.dds.frame_base, frame) || is_connected(lidar_frame, frame);
  };
  choose_sources(candidates, is_placed, config, reasons);
  const std::string body = body_of_odometry(candidates, config);
  if (is_connected(config.dds.frame_base, lidar_frame) || !is_connected(body, lidar_frame))
    return;
  reasons.of_key["dds.frame_base"] =
      fmt::format("of the odometry; /tf_static connects it with the lidar, but not {}", config.dds.frame_base);
  config.dds.frame_base = body;
}

} // namespace locus::tools
