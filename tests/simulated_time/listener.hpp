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

/// A ROS 2 machine that subscribes to the service's topics. Not thread-safe.
class Listener {
 public:
  struct Estimate {
    Stamp stamp; ///< by the wall clock
    Pose T_odom_base;
  };
  /// Start of a frame, as published on /locus/beginning.
  struct Beginning {
    Stamp stamp;
    std::string from;
  };

  explicit Listener(const daemon::DdsNode& node);

  /// Returns the estimates received since the previous call.
  std::vector<Estimate> new_estimates();
  std::vector<Beginning> new_beginnings();

 private:
  daemon::DdsReader<daemon::ros::Odometry> odometry_;
  daemon::DdsReader<daemon::ros::DiagnosticArray> beginning_;
};

} // namespace locus::test
