// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <vector>

#include "config/config.hpp"
#include "core/odometry/odometry.hpp"
#include "daemon/dds/ros_link.hpp"
#include "daemon/threads.hpp"

namespace locus::daemon {

/// Publishes the sweeps and the map from a separate thread, so that they never delay the odometry: a waiting cloud is
/// replaced by the next one.
class CloudPublisher {
 public:
  /// Starts the thread if sweeps or the map are to be published. `link` must outlive this.
  CloudPublisher(DdsOptions options, RosLink& link);

  /// Producer, one thread: hands over the clouds of a processed sweep.
  void submit(const Sweep& sweep, const Odometry& odometry, const OdometryEstimate& estimate);

 private:
  struct Cloud {
    std::vector<CloudMessage::Point> points;
    Stamp stamp;
  };

  void publish();

  DdsOptions options_;
  RosLink& link_;
  LatestSlot<Cloud> sweep_, map_;
  Stamp map_published_; ///< owned by the producer
  std::optional<Worker> worker_;
};

} // namespace locus::daemon
