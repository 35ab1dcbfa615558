// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "config/config.hpp"
#include "core/base/expected.hpp"
#include "core/base/stamp.hpp"
#include "drivers/lidar_survey.hpp"
#include "drivers/net/wire_tap.hpp"
#include "locusctl/live_topics.hpp"

namespace locus::tools {

/// Search for the lidars on all networks, and for the topics of ROS 2 on that of `dds`. One owner.
class SensorSearch {
 public:
  /// Throws Failure if no packets can be received.
  explicit SensorSearch(const DdsOptions& dds);

  /// Listens once more.
  void listen(Duration duration);

  /// Formats a comment for each lidar received so far and the configuration that fits, YAML with the reason for each
  /// line. Throws Failure if there is no lidar.
  [[nodiscard]] std::string proposal() const;

 private:
  DdsOptions dds_;
  WireTap wire_;
  Expected<LiveTopics, std::string> topics_;
  LidarSurvey survey_;
  Duration listened_{};
};

} // namespace locus::tools
