// SPDX-License-Identifier: Apache-2.0
#include "locusctl/sensors.hpp"

#include <algorithm>
#include <array>
#include <optional>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "config/config_proposal.hpp"
#include "config/config_yaml.hpp"
#include "discovery/lidar_candidates.hpp"
#include "drivers/lidar_input.hpp"
#include "locus_replay/failure.hpp"

namespace locus::tools {
namespace {

constexpr std::uint16_t kRoboSensePort = 6699, kSeyondPort = 8010, kLivoxPort = 56301;
constexpr std::array kDefaultPorts{kDefaultDataPort, kDefaultPositionPort, ouster::kDefaultLidarPort,
                                   kRoboSensePort,   kSeyondPort,          kLivoxPort};

std::string describe(const SurveyedLidar& lidar) {
  const std::string beams = lidar.beams > 0 ? fmt::format("-{}", lidar.beams) : "";
  const std::string model = lidar.ouster ? "Ouster" + beams : std::string{lidar.model};
  std::string mode{lidar.return_mode};
  if (lidar.columns_per_turn > 0)
    mode = fmt::format("{}x{:.0f}", lidar.columns_per_turn, lidar.rotation_rate_rpm / 60.0);
  std::string text =
      fmt::format("# {:<16}{:<7}{:<12}{:>5.0f} rpm  {:<10}{:>7.0f} packets/s  {}", dotted(lidar.ip), lidar.port, model,
                  lidar.rotation_rate_rpm, mode, lidar.packets_per_s, lidar.clock_state());
  if (lidar.ouster.value_or(0) > 0)
    text += fmt::format("  serial number {}", *lidar.ouster);
  return text + "\n";
}

std::string describe_unread(const SurveyedLidar& lidar) {
  const std::string_view help = remedy(*lidar.unknown_packets);
  return fmt::format("{:<16}{:<7}not read: {}{}{}\n", dotted(lidar.ip), lidar.port, to_string(*lidar.unknown_packets),
                     help.empty() ? "" : "; ", help);
}

/// Configuration of a robot, by what is on its networks.
class LiveProposal {
 public:
  void add_lidars(const std::vector<LidarCandidate>& candidates) {
    config_.lidars.clear();
    for (const LidarCandidate& one : candidates)
      add_lidar(one);
  }

  void add_topics(const LiveTopics& topics) {
    const std::vector<CloudCandidate> clouds = topics.clouds();
    for (const CloudCandidate& cloud : clouds)
      add_clouds(cloud, topics.transforms());
    const std::string lidar_frame = clouds.empty() ? "" : clouds.front().frame;
    choose_sources(
        topics.motion(),
        [&](const std::string& frame) {
          return topics.transforms().between(config_.dds.frame_base, frame) ||
                 topics.transforms().between(lidar_frame, frame);
        },
        config_, reasons_);
    for (const MotionCandidate& one : topics.motion())
      mount(one, topics.transforms());
  }

  /// Leaves out the sources whose topic nobody publishes.
  void reduce_sources(const std::vector<MotionCandidate>& published, const std::string& network) {
    for (std::size_t i = config_.motion_sources.size(); i-- > 0;)
      if (std::ranges::find(published, config_.motion_sources[i].topic, &MotionCandidate::topic) == published.end())
        leave_out_source(i, "nothing of its kind " + network, config_, reasons_);
    if (config_.motion_sources.empty())
      reasons_.of_key["motion_sources"] = "no IMU or odometry " + network;
  }

  void use(const DdsOptions& dds) {
    config_.dds.domain = dds.domain;
    config_.dds.interface = dds.interface;
    reasons_.of_other_keys = "as this command listened";
  }

  [[nodiscard]] bool has_lidars() const { return !config_.lidars.empty(); }
  [[nodiscard]] std::string text() const { return print_proposal(config_, reasons_); }

 private:
  [[nodiscard]] std::string next_name() const {
    return fmt::format("lidar{}", config_.lidars.size() + reasons_.other_lidars.size() + 1);
  }

  /// Adds a lidar and, for the file that only the sensor has, the command that fetches it: an Ouster requires it.
  void add_lidar(const LidarCandidate& one) {
    const std::string key = fmt::format("lidars.{}.", config_.lidars.size());
    LidarOptions& lidar = config_.lidars.emplace_back(one.options);
    lidar.name = fmt::format("lidar{}", config_.lidars.size());
    const std::string ip = dotted(one.found.ip);
    const std::string file = fmt::format("/etc/locusd/{}{}", lidar.name, one.found.ouster ? ".json" : ".csv");
    if (one.found.ouster)
      lidar.metadata = file;
    reasons_.of_key[key + "name"] = text_of(one.found);
    reasons_.of_key[key + "port"] = "where its packets go";
    if (lidar.source_ip)
      reasons_.of_key[key + "source_ip"] = "another lidar sends to the same port";
    reasons_.of_key[key + "T_base_lidar"] = "measure where it is on the robot";
    const std::string fetch = fmt::format("locusctl fetch {} -o {}", ip, file);
    if (one.found.ouster)
      reasons_.of_key[key + "metadata"] = "after " + fetch;
    else
      reasons_.of_key[key + "model"] =
          one.found.clock ? fmt::format("a Hesai; calibration: {} has its own angles, after {}", file, fetch)
                          : "by its packets";
    const std::array model{fmt::format("{}model={}", key, one.found.model)};
    if (const auto named = override_config(config_, model); named && !one.found.ouster)
      config_ = *named;
  }

  void add_clouds(const CloudCandidate& cloud, const StaticTransforms& transforms) {
    LidarOptions lidar;
    lidar.name = next_name();
    lidar.topic = cloud.topic;
    const auto T_base_lidar = transforms.between(config_.dds.frame_base, cloud.frame);
    lidar.T_base_lidar = T_base_lidar ? as_written(*T_base_lidar) : Pose{};
    const std::string what =
        fmt::format("clouds of {} points", cloud.points / std::max<std::size_t>(cloud.messages, 1));
    if (has_lidars()) {
      reasons_.other_lidars.push_back({lidar, what + "; packets, or clouds with more points, are preferred"});
      return;
    }
    config_.lidars.push_back(lidar);
    reasons_.of_key["lidars.0.topic"] = what;
    reasons_.of_key["lidars.0.T_base_lidar"] =
        T_base_lidar
            ? cloud.frame + " on the base, by /tf_static"
            : fmt::format("/tf_static does not place '{}' on {}: measure it", cloud.frame, config_.dds.frame_base);
  }

  void mount(const MotionCandidate& imu, const StaticTransforms& transforms) {
    const auto source = std::ranges::find(config_.motion_sources, imu.topic, &MotionSource::topic);
    const auto T_base_imu = transforms.between(config_.dds.frame_base, imu.frame);
    if (imu.kind != SourceKind::imu || source == config_.motion_sources.end())
      return;
    std::string& reason =
        reasons_.of_key[fmt::format("motion_sources.{}.T_base_source", source - config_.motion_sources.begin())];
    if (!T_base_imu) {
      reason = fmt::format("/tf_static does not place '{}' on {}: measure it, above all its rotation", imu.frame,
                           config_.dds.frame_base);
      return;
    }
    source->T_base_source = as_written(*T_base_imu);
    reason = imu.frame == config_.dds.frame_base ? "its frame is the base" : imu.frame + " on the base, by /tf_static";
  }

  Config config_;
  ConfigReasons reasons_;
};

} // namespace

SensorSearch::SensorSearch(const DdsOptions& dds)
    : dds_(dds), wire_(value_or_fail(WireTap::open(kDefaultPorts), ExitStatus::failed)),
      topics_(LiveTopics::join(dds)) {}

void SensorSearch::listen(Duration duration) {
  constexpr Duration kRound = std::chrono::milliseconds{100}; // the readers' history covers more
  for (const Duration end = listened_ + duration; listened_ < end; listened_ += kRound) {
    wire_.listen(kRound, [&](const Datagram& datagram) { survey_.add(datagram); });
    if (topics_)
      topics_->poll(Stamp{listened_ + kRound});
  }
}

std::string SensorSearch::proposal() const {
  std::string text, refused;
  for (const SurveyedLidar& lidar : survey_.lidars()) {
    if (lidar.is_known())
      text += describe(lidar);
    if (!lidar.unknown_packets)
      continue;
    refused += describe_unread(lidar);
    text += "# " + describe_unread(lidar);
  }
  LiveProposal proposal;
  proposal.add_lidars(lidar_candidates(survey_, kDefaultDataPort));
  if (topics_)
    proposal.add_topics(*topics_);
  if (!proposal.has_lidars())
    throw Failure(
        ExitStatus::failed,
        fmt::format("{}no lidar {}was received within {:.0f} s; check power, cable and the address it sends to{}",
                    refused, refused.empty() ? "" : "that can be read ", to_seconds(listened_),
                    topics_ ? "" : "; no topic of ROS 2 either: " + topics_.error()));
  proposal.reduce_sources(
      topics_ ? topics_->motion() : std::vector<MotionCandidate>{},
      topics_ ? fmt::format("in domain {} on {}; --domain and --interface choose another", dds_.domain, dds_.interface)
              : topics_.error());
  proposal.use(dds_);
  return text + proposal.text();
}

} // namespace locus::tools
