// SPDX-License-Identifier: Apache-2.0
#include "locus_replay/bag_cloud_lidar.hpp"

#include <algorithm>
#include <map>
#include <memory>
#include <optional>

#include <fmt/format.h>

#include "bags/bag.hpp"
#include "bags/messages.hpp"
#include "bags/static_transforms.hpp"
#include "drivers/clouds/cloud_layout.hpp"
#include "locus_replay/bag_topics.hpp"
#include "locus_replay/failure.hpp"
#include "locus_replay/ouster_metadata.hpp"

namespace locus::tools {
namespace {

/// Properties of a bag's clouds, from its first messages.
struct Clouds {
  struct Topic {
    std::size_t messages = 0, points = 0;
    std::string frame;
  };
  std::map<std::size_t, Topic> topics; ///< by topic index
  StaticTransforms transforms;
};

/// Reads ten seconds of the bag, or less once it has three clouds of each topic and the transforms.
Clouds look_into(Bag& bag) {
  constexpr Duration kLong = std::chrono::seconds{10};
  constexpr std::size_t kEnough = 3;
  Clouds clouds;
  const std::vector<BagTopic>& topics = bag.topics();
  bool waits_for_transforms = std::ranges::any_of(topics, [](const BagTopic& t) { return t.name == kStaticTopic; });
  const auto is_enough = [&] {
    return !waits_for_transforms &&
           std::ranges::all_of(clouds.topics, [](const auto& entry) { return entry.second.messages >= kEnough; });
  };
  for (std::size_t i = 0; i < topics.size(); ++i) {
    if (is_cloud_type(topics[i].type))
      clouds.topics[i];
  }
  std::optional<Stamp> first;
  for (const BagMessage* message = bag.next(); message != nullptr && !is_enough(); message = bag.next()) {
    first = first.value_or(message->recorded);
    if (message->recorded - *first > kLong)
      break;
    const BagTopic& topic = bag.topics()[message->topic];
    if (topic.type == kTransformsType && topic.name == kStaticTopic) {
      clouds.transforms.add({message->data, topic.serialisation});
      waits_for_transforms = false;
    }
    if (!is_cloud_type(topic.type))
      continue;
    Clouds::Topic& seen = clouds.topics[message->topic];
    ++seen.messages;
    if (const auto cloud = read_cloud({message->data, topic.serialisation}, topic.type)) {
      seen.points += points_of(*cloud);
      if (seen.messages == 1)
        seen.frame = cloud->frame;
    }
  }
  return clouds;
}

std::string other_topics(const Bag& bag, const Clouds& clouds, std::size_t used) {
  std::vector<std::string> others;
  for (const auto& [topic, unused] : clouds.topics) {
    if (topic != used)
      others.push_back(bag.topics()[topic].name);
  }
  return others.empty() ? ""
                        : fmt::format(", not {}, because it has most points; another is selected with --set "
                                      "lidars.0.topic={}",
                                      fmt::join(others, ", "), others.front());
}

} // namespace

void configure_clouds_of(const std::filesystem::path& bag_file, Config& config, std::vector<std::string>& lines) {
  const std::unique_ptr<Bag> bag = value_or_fail(open_bag(bag_file), ExitStatus::failed);
  const auto is_readable = [&](const BagTopic& topic) {
    return are_lidar_packets(topic) && (!is_ouster_type(topic.type) || has_metadata(bag_file));
  };
  if (std::ranges::any_of(bag->topics(), is_readable))
    return;
  const Clouds clouds = look_into(*bag);
  const auto most = std::ranges::max_element(clouds.topics, {}, [](const auto& entry) { return entry.second.points; });
  if (most == clouds.topics.end())
    return;
  const auto& [topic, seen] = *most;
  LidarOptions& lidar = config.lidars.front();
  lidar.topic = bag->topics()[topic].name;
  if (!lidar.topic.starts_with('/'))
    lidar.topic.insert(0, 1, '/');
  const bool has_packets = std::ranges::any_of(bag->topics(), are_lidar_packets);
  lines.push_back(fmt::format("{}: {}, so the clouds on {} are used{}", bag_file.string(),
                              has_packets ? "no metadata for the packets of its Ouster" : "no packets", lidar.topic,
                              other_topics(*bag, clouds, topic)));
  const std::string& base = config.dds.frame_base;
  if (const std::optional<Pose> T_base_lidar = clouds.transforms.between(base, seen.frame)) {
    lidar.T_base_lidar = *T_base_lidar;
    const Eigen::Vector3d& p = T_base_lidar->translation;
    const Eigen::Vector3d rpy_deg = to_rpy_rad(T_base_lidar->rotation) / kRadPerDeg;
    lines.push_back(
        fmt::format("{}: the lidar ({}) is mounted at {:.3f} {:.3f} {:.3f} m, {:.1f} {:.1f} {:.1f} deg on {}, by "
                    "/tf_static",
                    bag_file.string(), seen.frame, p.x(), p.y(), p.z(), rpy_deg.x(), rpy_deg.y(), rpy_deg.z(), base));
  } else {
    lines.push_back(fmt::format("{}: /tf_static has no mounting of the lidar ({}) on {}, so poses are those of the "
                                "lidar; set it with --set lidars.0.T_base_lidar.xyz_m=[X,Y,Z], and rpy_deg",
                                bag_file.string(), seen.frame, base));
  }
}

} // namespace locus::tools
