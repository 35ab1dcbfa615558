// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <vector>

#include "config/config.hpp"
#include "core/odometry/odometry.hpp"
#include "daemon/dds/ros_link.hpp"
#include "daemon/threads.hpp"

namespace locus::daemon {

/// Publishes the sweeps and the map from a thread of its own, so that they never delay the odometry: while one is on
/// its way the next waits, and the one after replaces it.
class CloudPublisher {
 public:
  /// `link` must outlive this. Idle where the configuration asks for neither.
  CloudPublisher(DdsOptions options, RosLink& link);

  /// Producer, one thread: what is worth publishing of a sweep that was processed.
  void take(const Sweep& sweep, const Odometry& odometry, const OdometryEstimate& estimate);

 private:
  struct Cloud {
    std::vector<CloudMessage::Point> points;
    Stamp stamp;
  };

  void publish();

  DdsOptions options_;
  RosLink& link_;
  LatestSlot<Cloud> sweep_, map_;
  Stamp map_published_; ///< of the producer
  std::optional<Worker> worker_;
};

} // namespace locus::daemon
