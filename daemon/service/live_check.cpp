// SPDX-License-Identifier: Apache-2.0
#include "daemon/service/live_check.hpp"

#include <algorithm>
#include <map>
#include <memory>
#include <optional>
#include <span>

#include <fmt/format.h>

#include "daemon/dds/cloud_reader.hpp"
#include "daemon/dds/dds_node.hpp"
#include "daemon/dds/publications.hpp"
#include "daemon/machine_time.hpp"
#include "daemon/service/machine.hpp"
#include "drivers/lidar_survey.hpp"
#include "drivers/net/wire_tap.hpp"

namespace locus::daemon {
namespace {

/// Subscription to the topic of a motion source or of a lidar's clouds.
struct Subscription {
  std::string label; ///< "imu NAME"
  std::string name;
  std::optional<DdsReader<ros::Imu>> imu{};
  std::optional<DdsReader<ros::Odometry>> odometry{};
  std::optional<CloudReader> clouds{};
  std::uint64_t messages = 0;
  std::uint32_t writers = 0;

  void poll(const DdsNode& node) {
    const auto count = [this](const auto&) { ++messages; };
    if (imu) {
      imu->take(count);
      writers = std::max(writers, imu->writers());
    }
    if (odometry) {
      odometry->take(count);
      writers = std::max(writers, odometry->writers());
    }
    if (clouds) {
      clouds->follow(node);
      clouds->take_serialised([this](const auto&, auto) { ++messages; });
      writers = std::max(writers, clouds->writers());
    }
  }
};

std::vector<Subscription> subscribe(const DdsNode& node, const Config& config) {
  std::vector<Subscription> topics;
  for (const LidarOptions& lidar : config.lidars) {
    if (lidar.gives_clouds())
      topics.emplace_back(Subscription{"lidar " + lidar.name, lidar.topic})
          .clouds.emplace(node, lidar.topic, TopicQos::cloud_count());
  }
  for (const MotionSource& source : config.motion_sources) {
    if (source.topic.empty())
      continue;
    Subscription& topic =
        topics.emplace_back(Subscription{fmt::format("{} {}", to_string(source.kind), source.name), source.topic});
    if (source.kind == SourceKind::imu)
      topic.imu.emplace(node, source.topic, TopicQos::sensor_in());
    else
      topic.odometry.emplace(node, source.topic, TopicQos::sensor_in());
  }
  return topics;
}

bool is_for(const SurveyedLidar& lidar, const LidarOptions& options) {
  return !options.gives_clouds() && lidar.port == options.port &&
         (!options.source_ip || lidar.ip == *options.source_ip);
}

/// Lists the lidars that match no entry of the configuration.
std::string unconfigured_lidars(const Config& config, const std::vector<SurveyedLidar>& lidars) {
  std::string text;
  for (const SurveyedLidar& lidar : lidars)
    if (lidar.is_known() &&
        std::ranges::none_of(config.lidars, [&](const auto& options) { return is_for(lidar, options); }))
      text += fmt::format("{}{} sends to port {}", text.empty() ? "" : ", ", lidar.name(), lidar.port);
  return text;
}

/// Returns a remedy for a lidar without packets.
std::string remedy(const LidarOptions& options, const Config& config, const std::vector<SurveyedLidar>& lidars,
                   bool captures_all) {
  if (const std::string others = unconfigured_lidars(config, lidars); !others.empty())
    return fmt::format("{}; if that is the lidar, set port and source_ip in the entry of {}", others, options.name);
  return captures_all ? "check its power, its cable and the address it sends to"
                      : "other ports were not checked: run as root to receive from all lidars, or use locusctl sensors";
}

void compare(const LidarOptions& options, const Config& config, const std::vector<SurveyedLidar>& lidars,
             bool captures_all, LiveCheck& check) {
  std::vector<const SurveyedLidar*> matching;
  for (const SurveyedLidar& lidar : lidars)
    if (is_for(lidar, options))
      matching.push_back(&lidar);
  const std::string& name = options.name;
  if (matching.empty()) {
    check.differences.push_back(fmt::format("lidar {}: no packets arrive at port {}{}; {}", name, options.port,
                                            options.source_ip ? " from " + dotted(*options.source_ip) : "",
                                            remedy(options, config, lidars, captures_all)));
    return;
  }
  const SurveyedLidar& lidar = *matching.front();
  if (matching.size() > 1)
    check.differences.push_back(
        fmt::format("lidar {}: {} and {} send to its port {}; give each its own entry with source_ip", name,
                    lidar.name(), matching[1]->name(), options.port));
  else if (!lidar.is_known())
    check.differences.push_back(
        fmt::format("lidar {}: the packets at port {} are not supported: {}", name, options.port,
                    lidar.unknown_packets ? to_string(*lidar.unknown_packets) : "no lidar packet"));
  else if (lidar.ouster.has_value() != options.is_ouster())
    check.differences.push_back(
        fmt::format("lidar {}: is configured as one of {}, but {} sends to port {}; set model{} in "
                    "its entry",
                    name,
                    options.is_ouster()         ? "Ouster"
                    : options.is_hesai()        ? "Hesai"
                    : options.is_of_any_maker() ? "Velodyne or Hesai"
                                                : "Velodyne",
                    lidar.name(), options.port, options.is_ouster() ? "" : " and metadata"));
  else if (!lidar.ouster && !options.is_of_any_maker() && options.is_hesai() != lidar.clock.has_value())
    check.differences.push_back(
        fmt::format("lidar {}: its calibration is for another maker than {}, which sends to port {}; "
                    "set model to auto in its entry, and calibration to the file of that sensor",
                    name, lidar.name(), options.port));
  else if (!lidar.ouster && !configured_model(options).empty() && configured_model(options) != lidar.model)
    check.differences.push_back(
        fmt::format("lidar {}: is configured as {}, but its packets are of {}; set model to auto in its entry", name,
                    configured_model(options), lidar.model));
  else if (!lidar.ouster && options.time == LidarTime::sensor && !lidar.is_synchronised())
    check.differences.push_back(
        fmt::format("lidar {}: time: sensor, but its clock state is {}; connect a GPS receiver or set "
                    "time to auto in its entry",
                    name, lidar.clock_state()));
  else
    check.matches.push_back(fmt::format("lidar {}: {} to port {}, {:.0f} packets/s, {}", name, lidar.name(),
                                        options.port, lidar.packets_per_s, lidar.clock_state()));
}

/// DDS types of the topics that are published.
using Types = std::map<std::string, std::string>;

void compare(const Subscription& topic, const Types& published, const DdsOptions& dds, Duration duration,
             LiveCheck& check) {
  const std::string about = fmt::format("{}: topic {}: ", topic.label, topic.name);
  const auto other = topic.writers == 0 ? published.find(topic.name) : published.end();
  if (other != published.end())
    check.differences.push_back(fmt::format("{}is published as {}; set {}another topic", about, other->second,
                                            topic.clouds ? "" : "its kind, or "));
  else if (topic.writers == 0)
    check.differences.push_back(fmt::format(
        "{}no publisher in domain {} on {}; check the name of the topic, and ROS_DOMAIN_ID and interface of its node",
        about, dds.domain, dds.interface));
  else if (topic.messages == 0)
    check.differences.push_back(fmt::format("{}its publisher has sent nothing", about));
  else if (topic.writers > 1)
    check.differences.push_back(fmt::format("{}{} nodes publish it, and only the first is used", about, topic.writers));
  else
    check.matches.push_back(
        fmt::format("{}{:.0f} messages/s", about, static_cast<double>(topic.messages) / to_seconds(duration)));
}

} // namespace

Expected<LiveCheck, std::string> check_live(const Config& config, Duration duration) {
  constexpr Duration kRound = std::chrono::milliseconds{100}; // readers' history covers more
  std::vector<std::uint16_t> ports;
  for (const auto& [port, needed] : lidar_ports(config))
    ports.push_back(port);
  auto wire = WireTap::open(ports);
  if (!wire)
    return wire.error();
  const auto member = UdpSocket::open(0); // joins the lidars' multicast groups, so that their packets arrive
  if (member)
    join_multicast(config, std::span(&*member, 1));
  LiveCheck check;
  auto node = DdsNode::open(config.dds);
  std::vector<Subscription> topics;
  std::optional<Publications> publications;
  Types published;
  if (node) {
    topics = subscribe(*node, config);
    publications.emplace(*node);
  } else {
    check.differences.push_back(node.error());
  }
  const auto store = [&](const std::string& name, std::string_view type) {
    published[name] = type;
    for (Subscription& topic : topics)
      if (topic.clouds)
        topic.clouds->discover(name, type);
  };

  LidarSurvey survey;
  for (Duration listened{}; listened < duration; listened += kRound) {
    wire->listen(kRound, [&](const Datagram& datagram) { survey.add(datagram); });
    if (publications)
      publications->take(store);
    for (Subscription& topic : topics)
      topic.poll(*node);
  }
  const std::vector<SurveyedLidar> lidars = survey.lidars();
  for (const LidarOptions& lidar : config.lidars)
    if (!lidar.gives_clouds())
      compare(lidar, config, lidars, wire->captures_all(), check);
  if (const std::string others = unconfigured_lidars(config, lidars); !others.empty() && check.differences.empty())
    check.matches.push_back(fmt::format("not configured: {}", others));
  for (const Subscription& topic : topics)
    compare(topic, published, config.dds, duration, check);
  return check;
}

} // namespace locus::daemon
