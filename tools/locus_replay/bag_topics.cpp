// SPDX-License-Identifier: Apache-2.0
#include "locus_replay/bag_topics.hpp"

#include <algorithm>
#include <array>
#include <functional>
#include <iterator>
#include <numeric>
#include <string_view>
#include <utility>

#include <fmt/format.h>

#include "bags/messages.hpp"
#include "drivers/clouds/cloud_view.hpp"
#include "locus_replay/failure.hpp"

namespace locus::tools {
namespace {

using Topics = std::vector<BagTopic>;
using Index = std::optional<std::size_t>;

std::string_view type_of(SourceKind kind) { return kind == SourceKind::imu ? kImuType : kOdometryType; }

bool is_imu_of_ouster(const BagTopic& topic) {
  return is_ouster_type(topic.type) && topic.name.ends_with("imu_packets");
}

/// Assigns the topics of one kind to lidars or motion sources.
class Dealer {
 public:
  template <class IsOfKind> Dealer(const Topics& topics, const IsOfKind& is_of_kind) : topics_(topics) {
    for (std::size_t i = 0; i < topics.size(); ++i) {
      if (is_of_kind(topics[i]))
        left_.push_back(i);
    }
  }

  /// Assigns the only topic whose name fits, if it is unique and `place` has none.
  template <class Fits> void deal(Index& place, const Fits& fits) {
    const auto is_fit = [&](std::size_t i) { return fits(topics_[i].name); };
    const auto found = std::ranges::find_if(left_, is_fit);
    if (place || found == left_.end() || std::find_if(std::next(found), left_.end(), is_fit) != left_.end())
      return;
    place = *found;
    left_.erase(found);
  }

  /// Assigns the last remaining topic to the last place without one.
  void finish(const std::vector<Index*>& places) {
    std::vector<Index*> waiting;
    std::ranges::copy_if(places, std::back_inserter(waiting), [](const Index* place) { return !place->has_value(); });
    if (left_.size() == 1 && waiting.size() == 1)
      *waiting.front() = std::exchange(left_, {}).front();
  }

  [[nodiscard]] std::string names_left() const {
    std::vector<std::string> names;
    for (const std::size_t i : left_)
      names.push_back(topics_[i].name);
    return fmt::format("{}", fmt::join(names, ", "));
  }
  [[nodiscard]] std::size_t left() const { return left_.size(); }

 private:
  const Topics& topics_;
  std::vector<std::size_t> left_;
};

/// Compares with or without the leading slash.
bool is_same_topic(std::string_view a, std::string_view b) {
  const auto bare = [](std::string_view name) { return name.substr(name.starts_with('/') ? 1 : 0); };
  return !a.empty() && bare(a) == bare(b);
}

bool is_segment(std::string_view name, std::string_view topic) {
  return fmt::format("/{}/", topic).find(fmt::format("/{}/", name)) != std::string::npos;
}

bool is_part(std::string_view name, std::string_view topic) { return topic.find(name) != std::string_view::npos; }

/// Sorts by name length: a topic of front_left contains front, too.
std::vector<std::size_t> longest_name_first(const std::vector<LidarOptions>& lidars) {
  std::vector<std::size_t> order(lidars.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::ranges::stable_sort(order, std::greater{}, [&](std::size_t i) { return lidars[i].name.size(); });
  return order;
}

std::string all_of(const Topics& topics) {
  std::vector<std::string> lines;
  for (const BagTopic& topic : topics)
    lines.push_back(fmt::format("{} ({})", topic.name, topic.type));
  return lines.empty() ? "no topics" : fmt::format("{}", fmt::join(lines, ", "));
}

/// Lists the supported types.
std::string packet_type_names() {
  std::vector<std::string_view> names;
  for (const PacketType& type : packet_types())
    names.push_back(type.name);
  return fmt::format("{}", fmt::join(names, ", "));
}

/// Returns whether the topic is not one of the defaults, that is, chosen by the user.
bool is_named(const std::string& topic) {
  static const Config kDefaults;
  return !topic.empty() && std::ranges::none_of(kDefaults.motion_sources, [&](const MotionSource& source) {
    return is_same_topic(source.topic, topic);
  });
}

/// Assigns cloud topics to the lidars with clouds.
void deal_clouds(const Bag& bag, const std::string& bag_name, const Config& config, BagTopics& chosen) {
  const Topics& topics = bag.topics();
  for (std::size_t i = 0; i < config.lidars.size(); ++i) {
    const std::string& topic = config.lidars[i].topic;
    if (topic.empty())
      continue;
    const auto found = std::ranges::find_if(
        topics, [&](const BagTopic& t) { return is_same_topic(t.name, topic) && is_cloud_type(t.type); });
    if (found != topics.end())
      chosen.of_lidar[i] = static_cast<std::size_t>(found - topics.begin());
    else
      chosen.doubts.push_back(fmt::format("{}: lidar {}: no clouds on {}, but {}; name its topic with --set "
                                          "lidars.{}.topic=TOPIC",
                                          bag_name, config.lidars[i].name, topic, all_of(topics), i));
  }
}

/// Describes how to use the clouds in a bag without packets; empty without any.
std::string clouds_instead(const Topics& topics, const Config& config) {
  const auto cloud = std::ranges::find_if(
      topics, [&](const BagTopic& topic) { return is_cloud_type(topic.type) && !are_results(topic, config); });
  return cloud == topics.end() ? ""
                               : fmt::format("{} ({}) has clouds of a lidar; select them with --set lidars.0.topic={}",
                                             cloud->name, cloud->type, cloud->name);
}

Index first_of_packets(const Config& config) {
  const auto found = std::ranges::find_if(config.lidars, [](const LidarOptions& l) { return !l.gives_clouds(); });
  return found == config.lidars.end() ? std::nullopt
                                      : std::optional{static_cast<std::size_t>(found - config.lidars.begin())};
}

[[noreturn]] void fail_without_packets(const Topics& topics, const std::string& bag_name, const Config& config) {
  const std::string instead = clouds_instead(topics, config);
  throw Failure(ExitStatus::failed,
                instead.empty()
                    ? fmt::format("{}: no {} in it, but {}; record the lidar's packets, mostly on /velodyne_packets",
                                  bag_name, packet_type_names(), all_of(topics))
                    : fmt::format("{}: no {} in it, but {}", bag_name, packet_type_names(), instead));
}

/// Assigns the IMU packets beside the lidar packets of each Ouster. Throws Failure for one without metadata.
void deal_ousters(const Topics& topics, const std::string& bag_name, const Config& config, BagTopics& chosen) {
  chosen.of_imu.resize(config.lidars.size());
  for (std::size_t i = 0; i < config.lidars.size(); ++i) {
    if (!chosen.of_lidar[i] || !is_ouster_type(topics[*chosen.of_lidar[i]].type))
      continue;
    const BagTopic& packets = topics[*chosen.of_lidar[i]];
    if (!config.lidars[i].is_ouster())
      throw Failure(ExitStatus::wrong_usage,
                    fmt::format("{}: {} is of an Ouster, whose packets cannot be read without its metadata: neither "
                                "the bag nor a .json file beside it has those; name a file with --set "
                                "lidars.{}.metadata=FILE",
                                bag_name, packets.name, i));
    const auto found = std::ranges::find_if(topics, [&](const BagTopic& topic) {
      return is_imu_of_ouster(topic) && namespace_of(topic.name) == namespace_of(packets.name);
    });
    if (found != topics.end() && config.lidars[i].imu_port != 0)
      chosen.of_imu[i] = static_cast<std::size_t>(found - topics.begin());
  }
}

/// Assigns packet topics to the lidars with packets, `first` of them first.
void deal_packets(Dealer& dealer, const std::string& bag_name, const Config& config, std::size_t first,
                  BagTopics& chosen) {
  std::vector<Index*> places;
  for (std::size_t i = 0; i < config.lidars.size(); ++i) {
    if (!config.lidars[i].gives_clouds())
      places.push_back(&chosen.of_lidar[i]);
  }
  for (const auto is_in : {&is_segment, &is_part}) {
    for (const std::size_t i : longest_name_first(config.lidars)) {
      if (!config.lidars[i].gives_clouds())
        dealer.deal(chosen.of_lidar[i], [&](const std::string& topic) { return is_in(config.lidars[i].name, topic); });
    }
  }
  dealer.finish(places);
  if (std::ranges::none_of(chosen.of_lidar, [](const Index& topic) { return topic.has_value(); }))
    throw Failure(ExitStatus::wrong_usage,
                  fmt::format("{}: it is not clear which of {} is lidar {}; give it a name that is part of one with "
                              "--set lidars.{}.name=NAME",
                              bag_name, dealer.names_left(), config.lidars[first].name, first));
  for (std::size_t i = 0; i < config.lidars.size(); ++i) {
    if (!chosen.of_lidar[i] && !config.lidars[i].gives_clouds() && dealer.left() > 0)
      chosen.doubts.push_back(fmt::format("{}: lidar {}: it is not clear whether it is one of {}; give it a name that "
                                          "is part of one with --set lidars.{}.name=NAME",
                                          bag_name, config.lidars[i].name, dealer.names_left(), i));
  }
}

void deal_lidars(const Bag& bag, const std::string& bag_name, const Config& config, BagTopics& chosen) {
  chosen.of_lidar.resize(config.lidars.size());
  deal_clouds(bag, bag_name, config, chosen);
  const bool has_clouds = std::ranges::any_of(chosen.of_lidar, [](const Index& topic) { return topic.has_value(); });
  const Index first = first_of_packets(config);
  if (!first && !has_clouds)
    throw Failure(ExitStatus::wrong_usage, chosen.doubts.front());
  Dealer dealer(bag.topics(), are_lidar_packets);
  if (dealer.left() == 0 && !has_clouds)
    fail_without_packets(bag.topics(), bag_name, config);
  if (first && dealer.left() > 0)
    deal_packets(dealer, bag_name, config, *first, chosen);
  deal_ousters(bag.topics(), bag_name, config, chosen);
}

void deal_sources(const Bag& bag, const std::string& bag_name, const Config& config,
                  const std::function<bool(SourceId)>& has_file, SourceKind kind, BagTopics& chosen) {
  const std::vector<MotionSource>& sources = config.motion_sources;
  const auto is_wanted = [&](std::size_t i) { return sources[i].kind == kind && !has_file(SourceId{i}); };
  const auto is_named_by_user = [&](const BagTopic& topic) {
    return std::ranges::any_of(sources,
                               [&](const MotionSource& source) { return is_same_topic(source.topic, topic.name); });
  };
  Dealer dealer(bag.topics(), [&](const BagTopic& topic) {
    return topic.type == type_of(kind) && (!are_results(topic, config) || is_named_by_user(topic));
  });
  std::vector<Index*> nameless;
  for (std::size_t i = 0; i < sources.size(); ++i) {
    if (!is_wanted(i))
      continue;
    dealer.deal(chosen.of_source[i], [&](const std::string& topic) { return is_same_topic(topic, sources[i].topic); });
    if (!is_named(sources[i].topic))
      nameless.push_back(&chosen.of_source[i]);
  }
  dealer.finish(nameless);
  for (std::size_t i = 0; i < sources.size(); ++i) {
    if (is_wanted(i) && !chosen.of_source[i] && dealer.left() > 0)
      chosen.doubts.push_back(fmt::format("{}: motion source {}: nothing on {}, and it is not clear whether it is "
                                          "one of {}; name it with --set motion_sources.{}.topic=TOPIC",
                                          bag_name, sources[i].name, sources[i].topic, dealer.names_left(),
                                          sources[i].name));
  }
}

std::string describe(const Bag& bag, const std::string& bag_name, const Config& config, const BagTopics& chosen) {
  std::vector<std::string> used, left_out;
  std::vector<bool> is_used(bag.topics().size());
  const auto add_used = [&](const std::string& name, const Index& topic) {
    if (!topic)
      return;
    is_used[*topic] = true;
    used.push_back(fmt::format("{} is {}", bag.topics()[*topic].name, name));
  };
  for (std::size_t i = 0; i < chosen.of_lidar.size(); ++i)
    add_used("lidar " + config.lidars[i].name, chosen.of_lidar[i]);
  for (std::size_t i = 0; i < chosen.of_imu.size(); ++i)
    add_used(config.lidars[i].name + "_imu", chosen.of_imu[i]);
  for (std::size_t i = 0; i < chosen.of_source.size(); ++i)
    add_used(config.motion_sources[i].name, chosen.of_source[i]);
  for (std::size_t i = 0; i < bag.topics().size(); ++i) {
    const BagTopic& topic = bag.topics()[i];
    if (!is_used[i] && (packet_type(topic.type) != nullptr || is_cloud_type(topic.type) || topic.type == kImuType ||
                        topic.type == kOdometryType))
      left_out.push_back(topic.name);
  }
  return fmt::format("{}: {}{}{}", bag_name, fmt::join(used, ", "),
                     left_out.empty() ? "" : "; not used: ", fmt::join(left_out, ", "));
}

} // namespace

bool are_lidar_packets(const BagTopic& topic) { return packet_type(topic.type) != nullptr && !is_imu_of_ouster(topic); }

bool are_results(const BagTopic& topic, const Config& config) {
  return is_same_topic(topic.name, config.dds.prefix + "/odometry") ||
         is_same_topic(topic.name, config.dds.prefix + "/cloud");
}

std::string_view namespace_of(std::string_view topic) { return topic.substr(0, topic.rfind('/') + 1); }

BagTopics BagTopics::choose(const Bag& bag, const std::string& bag_name, const Config& config,
                            const std::function<bool(SourceId)>& has_file) {
  BagTopics chosen;
  deal_lidars(bag, bag_name, config, chosen);
  chosen.of_source.resize(config.motion_sources.size());
  for (const SourceKind kind : {SourceKind::imu, SourceKind::odometry})
    deal_sources(bag, bag_name, config, has_file, kind, chosen);
  chosen.used = describe(bag, bag_name, config, chosen);
  return chosen;
}

} // namespace locus::tools
