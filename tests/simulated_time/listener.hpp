// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "core/base/pose.hpp"
#include "core/base/stamp.hpp"
#include "daemon/dds/dds_node.hpp"

namespace locus::test {

/// A ROS 2 machine that hears what the service publishes. One owner.
class Listener {
 public:
  struct Estimate {
    Stamp stamp; ///< as the clock on the wall had it
    Pose T_odom_base;
  };
  /// A frame that begins, as /locus/beginning tells of it.
  struct Beginning {
    Stamp stamp;
    std::string from;
  };

  explicit Listener(const daemon::DdsNode& node);

  /// What has come since the last call.
  std::vector<Estimate> new_estimates();
  std::vector<Beginning> new_beginnings();

 private:
  daemon::DdsReader<daemon::ros::Odometry> odometry_;
  daemon::DdsReader<daemon::ros::DiagnosticArray> beginning_;
};

} // namespace locus::test
