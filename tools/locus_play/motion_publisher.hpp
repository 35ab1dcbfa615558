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

/// Publishes recorded motion samples on the topics that the configuration names, as the drivers of the robot do, and
/// the time of the recording, if there is to be a clock. One owner.
class MotionPublisher {
 public:
  static constexpr Duration kClockPeriod = std::chrono::milliseconds{10}; ///< of /clock, however fast its time goes

  /// Throws Failure.
  MotionPublisher(const Config& config, bool clock);

  void publish(const daemon::ImuInput& input, Duration shift);
  void publish(const daemon::OdometryInput& input, Duration shift);

  /// To be told of every moment; publishes it when the period is over, and never one that is not later than the last.
  void tell_time(Stamp now);

  /// Topics to which nobody listens.
  [[nodiscard]] std::vector<std::string> unheard() const;
  /// Samples that DDS did not take.
  [[nodiscard]] std::uint64_t refused() const { return refused_; }
  /// For whatever else this process has to say or hear in the domain.
  [[nodiscard]] const daemon::DdsNode& node() const { return node_; }

 private:
  daemon::DdsNode node_;
  std::string frame_odom_, frame_base_;
  std::vector<std::string> topics_; ///< by source
  std::map<SourceId, daemon::DdsWriter<daemon::ros::Imu>> imus_;
  std::map<SourceId, daemon::DdsWriter<daemon::ros::Odometry>> odometries_;
  std::optional<daemon::DdsWriter<daemon::ros::Clock>> clock_;
  Stamp clock_shows_ = Stamp::min();
  Duration clock_due_{}; ///< CLOCK_MONOTONIC
  std::uint64_t refused_ = 0;
};

} // namespace locus::tools
