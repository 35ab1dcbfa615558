// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "config/config.hpp"
#include "core/base/expected.hpp"
#include "daemon/dds/cloud_reader.hpp"
#include "daemon/dds/dds_node.hpp"
#include "daemon/dds/publications.hpp"
#include "daemon/dds/ros_messages.hpp"
#include "discovery/motion_candidates.hpp"
#include "discovery/static_transforms.hpp"

namespace locus::tools {

/// Clouds of a topic on a network.
struct CloudCandidate {
  std::string topic, frame;
  std::size_t messages = 0, points = 0;
};

/// Sensors that ROS 2 nodes publish: finds the topics of IMUs, odometries and clouds, and receives them and /tf_static.
/// One owner.
class LiveTopics {
 public:
  static constexpr std::size_t kMostTopics = 64; ///< more than any robot has; further ones are ignored

  /// Joins the network. Fails with one line for the user.
  static Expected<LiveTopics, std::string> join(const DdsOptions& options);

  /// Subscribes to new topics and receives what has arrived until `now`, by any clock.
  void poll(Stamp now);

  [[nodiscard]] std::vector<MotionCandidate> motion() const; ///< those that have sent something
  [[nodiscard]] std::vector<CloudCandidate> clouds() const;  ///< likewise; the most points first
  [[nodiscard]] const StaticTransforms& transforms() const { return transforms_; }

 private:
  struct Motion {
    MotionCandidate candidate;
    std::optional<daemon::DdsReader<daemon::ros::Imu>> imu{};
    std::optional<daemon::DdsReader<daemon::ros::Odometry>> odometry{};
  };
  struct Clouds {
    CloudCandidate candidate;
    daemon::CloudReader reader;
  };

  LiveTopics(daemon::DdsNode node, const DdsOptions& options);
  void subscribe_to(const std::string& topic, std::string_view type);
  void receive_clouds(Clouds& clouds);
  void receive_transforms();

  daemon::DdsNode node_;
  std::string results_; ///< prefix of the topics of locusd
  daemon::Publications publications_;
  daemon::DdsReader<daemon::ros::TFMessage> static_tf_;
  std::map<std::string, Motion> motion_; ///< by topic
  std::map<std::string, Clouds> clouds_; ///< by topic
  std::vector<std::byte> message_;       ///< serialised cloud
  StaticTransforms transforms_;
};

} // namespace locus::tools
