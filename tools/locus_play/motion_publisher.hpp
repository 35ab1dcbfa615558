// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "config/config.hpp"
#include "daemon/dds/dds_node.hpp"
#include "daemon/input.hpp"

namespace locus::tools {

/// Publishes recorded motion samples on the topics that the configuration names, as the drivers of the robot do. One
/// owner.
class MotionPublisher {
 public:
  /// Throws Failure.
  explicit MotionPublisher(const Config& config);

  void publish(const daemon::ImuInput& input, Duration shift);
  void publish(const daemon::OdometryInput& input, Duration shift);

  /// Topics to which nobody listens.
  [[nodiscard]] std::vector<std::string> unheard() const;
  /// Samples that DDS did not take.
  [[nodiscard]] std::uint64_t refused() const { return refused_; }

 private:
  daemon::DdsNode node_;
  std::string frame_odom_, frame_base_;
  std::vector<std::string> topics_; ///< by source
  std::map<SourceId, daemon::DdsWriter<daemon::ros::Imu>> imus_;
  std::map<SourceId, daemon::DdsWriter<daemon::ros::Odometry>> odometries_;
  std::uint64_t refused_ = 0;
};

} // namespace locus::tools
