// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "config/config.hpp"
#include "daemon/dds/dds_node.hpp"
#include "daemon/input.hpp"

namespace locus::tools {

/// Publishes recorded motion samples on the configured topics, as the drivers of the robot do, and optionally the time
/// of the recording. One owner.
class MotionPublisher {
 public:
  static constexpr Duration kClockPeriod = std::chrono::milliseconds{10}; ///< of /clock, whatever the playback speed

  /// Throws Failure.
  MotionPublisher(const Config& config, bool clock);

  void publish(daemon::ImuInput input, Duration shift);
  void publish(daemon::OdometryInput input, Duration shift);

  /// Publishes the clock if a period has passed, and never backwards. Call with every new time.
  void publish_clock(Stamp now);

  /// Returns topics without subscribers.
  [[nodiscard]] std::vector<std::string> topics_without_subscribers() const;
  /// Returns the number of samples rejected by DDS.
  [[nodiscard]] std::uint64_t refused() const { return refused_; }
  /// DDS node, for other publishers and readers of this process.
  [[nodiscard]] const daemon::DdsNode& node() const { return node_; }

 private:
  daemon::DdsNode node_;
  std::string frame_odom_, frame_base_;
  std::vector<std::string> topics_; ///< by source index
  std::map<SourceId, daemon::DdsWriter<daemon::ros::Imu>> imus_;
  std::map<SourceId, daemon::DdsWriter<daemon::ros::Odometry>> odometries_;
  std::optional<daemon::DdsWriter<daemon::ros::Clock>> clock_;
  Stamp published_time_ = Stamp::min();
  Duration clock_due_{}; ///< CLOCK_MONOTONIC
  std::uint64_t refused_ = 0;
};

} // namespace locus::tools
