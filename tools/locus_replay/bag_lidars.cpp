// SPDX-License-Identifier: Apache-2.0
#include "locus_replay/bag_cloud_lidar.hpp"

#include <algorithm>
#include <cstddef>

#include <fmt/format.h>

#include "bags/messages.hpp"
#include "drivers/clouds/cloud_view.hpp"
#include "locus_replay/bag_topics.hpp"
#include "locus_replay/ouster_metadata.hpp"

namespace locus::tools {
namespace {

/// Lists the topics of clouds, except the results of locusd.
std::vector<std::size_t> cloud_topics(const BagSurvey& survey, const Config& config) {
  std::vector<std::size_t> indices;
  for (const auto& [index, unused] : survey.topics) {
    const BagTopic& topic = survey.bag->topics()[index];
    if (is_cloud_type(topic.type) && !are_results(topic, config))
      indices.push_back(index);
  }
  return indices;
}

std::string other_topics(const Bag& bag, const std::vector<std::size_t>& clouds, std::size_t used) {
  std::vector<std::string> others;
  for (const std::size_t topic : clouds) {
    if (topic != used)
      others.push_back(bag.topics()[topic].name);
  }
  return others.empty() ? ""
                        : fmt::format(", not {}, because it has most points; another is selected with --set "
                                      "lidars.0.topic={}",
                                      fmt::join(others, ", "), others.front());
}

} // namespace

void configure_clouds_of(const BagSurvey& survey, const std::filesystem::path& bag_file, Config& config,
                         std::vector<std::string>& lines) {
  const std::vector<BagTopic>& topics = survey.bag->topics();
  const auto is_readable = [&](const BagTopic& topic) {
    return are_lidar_packets(topic) && (!is_ouster_type(topic.type) || has_metadata(bag_file));
  };
  if (std::ranges::any_of(topics, is_readable))
    return;
  const std::vector<std::size_t> clouds = cloud_topics(survey, config);
  const auto most =
      std::ranges::max_element(clouds, {}, [&](std::size_t topic) { return survey.topics.at(topic).points; });
  if (most == clouds.end())
    return;
  LidarOptions& lidar = config.lidars.front();
  lidar.topic = topics[*most].name;
  if (!lidar.topic.starts_with('/'))
    lidar.topic.insert(0, 1, '/');
  const bool has_packets = std::ranges::any_of(topics, are_lidar_packets);
  lines.push_back(fmt::format("{}: {}, so the clouds on {} are used{}", bag_file.string(),
                              has_packets ? "no metadata for the packets of its Ouster" : "no packets", lidar.topic,
                              other_topics(*survey.bag, clouds, *most)));
}

} // namespace locus::tools
