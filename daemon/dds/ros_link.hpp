// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <string_view>
#include <thread>
#include <variant>
#include <vector>

#include "config/config.hpp"
#include "daemon/dds/dds_node.hpp"
#include "daemon/dds/ros_graph.hpp"
#include "daemon/dds/ros_messages.hpp"
#include "daemon/figures.hpp"
#include "daemon/input.hpp"

namespace locus::daemon {

/// Somebody outside says whether the ground is flat (flat_ground_topic).
struct FlatGroundWord {
  bool flat;
};

/// All that comes in by DDS, but clouds.
using RosInput = std::variant<ImuInput, OdometryInput, OutsideVerdict, FlatGroundWord>;

/// Takes a cloud of the lidar of this index.
using RosCloudSink = std::function<void(std::uint8_t lidar, Stamp arrival, const SerialisedSample& cloud)>;

/// The robot's network in ROS 2's words: the configured topics in, odometry and what goes with it out.
///
/// Comes up by itself: while there is no network it is tried again, less and less often, and what is published
/// meanwhile is lost. Inputs are handed over in the thread of the link, stamped with their arrival.
class RosLink {
 public:
  using Sink = std::function<void(const RosInput&)>;

  /// Begins at once and does not wait. `instance`: of the service, empty if it is the only one. `cloud_sink`: needed
  /// where a lidar of the configuration gives clouds.
  RosLink(const Config& config, Sink sink, std::string_view instance = {}, RosCloudSink cloud_sink = {});
  ~RosLink();
  RosLink(const RosLink&) = delete;
  RosLink& operator=(const RosLink&) = delete;

  /// Each by one thread at a time; false while there is no network, or a reader holds it up.
  bool publish(const OdometryReport& report, TrackingState state); ///< odometry, state and, if asked for, tf
  bool publish_fast(const OdometryReport& report);
  bool publish_cloud(std::span<const CloudMessage::Point> points, Stamp stamp); ///< base frame
  bool publish_map(std::span<const CloudMessage::Point> points, Stamp stamp);   ///< odom frame
  bool publish(const DiagnosticsMessage& diagnostics);
  bool publish_beginning(const DiagnosticsMessage& beginning); ///< who comes later hears it, too

  /// Any thread.
  [[nodiscard]] LinkFigures status() const;
  /// Grows as long as the thread of the link lives, at least ten times a second.
  [[nodiscard]] std::uint64_t progress() const { return progress_.load(std::memory_order_relaxed); }

 private:
  struct Session;

  void run();
  [[nodiscard]] std::unique_ptr<Session> connect();
  void receive(Session& session);
  void look_after_sources(Session& session);
  [[nodiscard]] Session* session() const { return connected_.load(std::memory_order_acquire); }

  Config config_;
  FrameNames frames_;
  RosNode named_;
  Sink sink_;
  RosCloudSink cloud_sink_;
  CloudMessage cloud_, map_;
  std::unique_ptr<Session> session_;         ///< made by the thread of the link
  std::atomic<Session*> connected_{nullptr}; ///< the same once it is complete
  mutable std::mutex status_mutex_;          ///< no thread of the packet path takes it
  LinkFigures status_;
  std::atomic<std::uint64_t> progress_{0};
  std::atomic<bool> stopping_{false};
  std::thread thread_;
};

} // namespace locus::daemon
