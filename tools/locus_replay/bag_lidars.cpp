// SPDX-License-Identifier: Apache-2.0
#include "locus_replay/bag_lidars.hpp"

#include <algorithm>
#include <cctype>
#include <cstddef>
#include <iterator>

#include <fmt/format.h>

#include "bags/messages.hpp"
#include "drivers/clouds/cloud_view.hpp"
#include "locus_replay/bag_topics.hpp"
#include "locus_replay/ouster_metadata.hpp"

namespace locus::tools {
namespace {

using Indices = std::vector<std::size_t>; ///< in Bag::topics()

template <class IsWanted> Indices topics_of(const Bag& bag, const IsWanted& is_wanted) {
  Indices indices;
  for (std::size_t i = 0; i < bag.topics().size(); ++i)
    if (is_wanted(bag.topics()[i]))
      indices.push_back(i);
  return indices;
}

std::vector<std::string> segments_of(const std::string& topic) {
  std::vector<std::string> segments{""};
  for (const char c : topic)
    c == '/' ? void(segments.emplace_back()) : segments.back().push_back(c);
  return segments;
}

bool is_name(const std::string& word) {
  const auto is_allowed = [](unsigned char c) { return std::isalnum(c) != 0 || c == '_' || c == '-'; };
  return !word.empty() && std::isalpha(static_cast<unsigned char>(word.front())) != 0 &&
         std::ranges::all_of(word, is_allowed);
}

/// Returns the part of a topic that no other one has: "front" of /front/velodyne_packets. Empty without such a part, as
/// for /husky1/velodyne_packets beside /husky1/velodyne_front/velodyne_packets.
std::string own_part(const std::string& topic, const Indices& packets, const Bag& bag) {
  for (const std::string& part : segments_of(topic)) {
    const auto has_part = [&](std::size_t other) {
      return std::ranges::count(segments_of(bag.topics()[other].name), part) > 0;
    };
    if (is_name(part) && std::ranges::count_if(packets, has_part) == 1)
      return part;
  }
  return "";
}

/// Names the lidar of a topic; that of the only topic without a part of its own is recognised by the others' names.
std::string name_for(const std::string& topic, const Indices& packets, const Bag& bag) {
  const std::string part = own_part(topic, packets, bag);
  return part.empty() ? "lidar" : part;
}

/// Configures the lidars of one bag.
class BagLidars {
 public:
  BagLidars(const BagSurvey& survey, const std::filesystem::path& bag_file, Config& config,
            std::vector<std::string>& lines, ConfigReasons& reasons)
      : survey_(survey), bag_file_(bag_file.string()), config_(config), lines_(lines), reasons_(reasons) {}

  /// Returns the frame of the first lidar, as use_clouds() does.
  std::string use_packets(const Indices& packets) {
    const LidarOptions usual = config_.lidars.front();
    const Indices used = placed_ones(packets);
    config_.lidars.clear();
    for (const std::size_t i : used) {
      const std::string key = fmt::format("lidars.{}.", config_.lidars.size());
      LidarOptions& lidar = config_.lidars.emplace_back(usual);
      lidar.port = static_cast<std::uint16_t>(usual.port + config_.lidars.size() - 1);
      if (packets.size() > 1)
        lidar.name = name_for(topic(i).name, packets, *survey_.bag);
      reasons_.of_key[key + "name"] = fmt::format("packets on {} ({})", topic(i).name, topic(i).type);
      if (used.size() > 1)
        reasons_.of_key[key + "port"] = "distinguishes the lidars; the packets of a bag have no ports";
    }
    for (const std::size_t i : packets)
      if (std::ranges::find(used, i) == used.end())
        leave_out_packets(i, usual, packets);
    return frame_of(used.front());
  }

  std::string use_clouds(const Indices& clouds, bool has_packets) {
    const std::size_t most =
        *std::ranges::max_element(clouds, {}, [&](std::size_t i) { return survey_.topics.at(i).points; });
    LidarOptions& lidar = config_.lidars.front();
    lidar.topic = absolute(topic(most).name);
    const std::string why = has_packets ? "no metadata for the packets of its Ouster" : "no packets";
    reasons_.of_key["lidars.0.topic"] = fmt::format("{}, {:.0f} points each; {}{}", topic(most).type, points(most), why,
                                                    clouds.size() > 1 ? ", and most points of the clouds" : "");
    lines_.push_back(
        fmt::format("{}: {}, so the clouds on {} are used{}", bag_file_, why, lidar.topic, other_clouds(clouds, most)));
    for (const std::size_t i : clouds)
      if (i != most)
        leave_out_clouds(i, fmt::format("fewer points: {:.0f} each, {} has {:.0f}; the same lidar's, or another's",
                                        points(i), lidar.topic, points(most)));
    return frame_of(most);
  }

  void leave_out_clouds(std::size_t index, const std::string& reason) {
    LidarOptions lidar;
    lidar.name = fmt::format("lidar{}", reasons_.other_lidars.size() + 2);
    lidar.topic = absolute(topic(index).name);
    reasons_.other_lidars.push_back({lidar, reason});
  }

 private:
  [[nodiscard]] const BagTopic& topic(std::size_t index) const { return survey_.bag->topics()[index]; }

  /// Returns the mean number of points of a cloud.
  [[nodiscard]] double points(std::size_t index) const {
    const BagSurvey::Topic& surveyed = survey_.topics.at(index);
    return static_cast<double>(surveyed.points) / static_cast<double>(std::max<std::size_t>(surveyed.messages, 1));
  }

  static std::string absolute(const std::string& topic) { return topic.starts_with('/') ? topic : '/' + topic; }

  [[nodiscard]] std::string frame_of(std::size_t index) const {
    const auto found = survey_.topics.find(index);
    return found == survey_.topics.end() ? "" : found->second.frame;
  }

  /// Returns the lidars that can be used together: those placed on the base, else those placed on the first with a name
  /// of its own, by which its topic is recognised.
  [[nodiscard]] Indices placed_ones(const Indices& packets) const {
    const auto is_nameless = [&](std::size_t i) { return own_part(topic(i).name, packets, *survey_.bag).empty(); };
    if (packets.size() == 1)
      return packets;
    const auto named = std::ranges::find_if_not(packets, is_nameless);
    const std::size_t first = named == packets.end() ? packets.front() : *named;
    for (const std::string& base : {config_.dds.frame_base, frame_of(first)}) {
      Indices placed;
      std::ranges::copy_if(packets, std::back_inserter(placed), [&](std::size_t i) {
        return !frame_of(i).empty() && survey_.transforms.between(base, frame_of(i)).has_value();
      });
      const bool are_recognised = std::ranges::count_if(placed, is_nameless) == 0 ||
                                  (placed == packets && std::ranges::count_if(placed, is_nameless) == 1);
      if (!placed.empty() && are_recognised)
        return placed;
    }
    return {first};
  }

  void leave_out_packets(std::size_t index, const LidarOptions& usual, const Indices& packets) {
    LidarOptions lidar = usual;
    lidar.name = name_for(topic(index).name, packets, *survey_.bag);
    lidar.port = static_cast<std::uint16_t>(usual.port + config_.lidars.size() + reasons_.other_lidars.size());
    lines_.push_back(fmt::format("{}: the packets on {} are not used, because /tf_static does not place their lidar on "
                                 "the robot",
                                 bag_file_, topic(index).name));
    reasons_.other_lidars.push_back(
        {lidar, fmt::format("packets on {} ({}); /tf_static does not place its lidar on the robot: measure and add "
                            "T_base_lidar",
                            topic(index).name, topic(index).type)});
  }

  [[nodiscard]] std::string other_clouds(const Indices& clouds, std::size_t used) const {
    std::vector<std::string> others;
    for (const std::size_t i : clouds)
      if (i != used)
        others.push_back(topic(i).name);
    return others.empty() ? ""
                          : fmt::format(", not {}, because it has most points; another is selected with --set "
                                        "lidars.0.topic={}",
                                        fmt::join(others, ", "), others.front());
  }

  const BagSurvey& survey_;
  std::string bag_file_;
  Config& config_;
  std::vector<std::string>& lines_;
  ConfigReasons& reasons_;
};

} // namespace

std::string configure_lidars_of(const BagSurvey& survey, const std::filesystem::path& bag_file, Config& config,
                                std::vector<std::string>& lines, ConfigReasons& reasons) {
  const Bag& bag = *survey.bag;
  const bool has_packets = std::ranges::any_of(bag.topics(), are_lidar_packets);
  const Indices packets = topics_of(bag, [&](const BagTopic& topic) {
    return are_lidar_packets(topic) && (!is_ouster_type(topic.type) || has_metadata(bag_file));
  });
  const Indices clouds =
      topics_of(bag, [&](const BagTopic& topic) { return is_cloud_type(topic.type) && !are_results(topic, config); });
  BagLidars lidars(survey, bag_file, config, lines, reasons);
  if (packets.empty() && !clouds.empty())
    return lidars.use_clouds(clouds, has_packets);
  if (packets.empty())
    return "";
  const std::string frame = lidars.use_packets(packets);
  for (const std::size_t i : clouds)
    lidars.leave_out_clouds(i, "clouds; the packets are used, from which most drivers make these");
  return frame;
}

} // namespace locus::tools
