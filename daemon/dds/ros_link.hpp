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

/// External message whether the ground is flat (flat_ground_topic).
struct FlatGroundMessage {
  bool flat;
};

/// Any input over DDS except clouds.
using RosInput = std::variant<ImuInput, OdometryInput, ExternalHealth, FlatGroundMessage>;

/// Receives a cloud of the lidar with this index; its type is that of read_cloud().
using RosCloudSink =
    std::function<void(std::uint8_t lidar, Stamp arrival, std::string_view type, const SerialisedSample& cloud)>;

/// Link to the robot's ROS 2 network: subscribes to the configured topics, publishes odometry and related messages.
///
/// Connects in the background: without a network it retries at increasing intervals, and messages published meanwhile
/// are dropped. Inputs are handed over in the link's thread, stamped with their arrival.
class RosLink {
 public:
  using Sink = std::function<void(const RosInput&)>;

  /// Starts the link's thread and does not wait. `instance` is the name of a service instance, otherwise empty.
  /// `cloud_sink` is required if a configured lidar publishes clouds.
  RosLink(const Config& config, Sink sink, std::string_view instance = {}, RosCloudSink cloud_sink = {});
  ~RosLink();
  RosLink(const RosLink&) = delete;
  RosLink& operator=(const RosLink&) = delete;

  /// Publish a message, each function from one thread at a time; false without a network or while a reader blocks it.
  bool publish(const OdometryReport& report, TrackingState state); ///< odometry, state and, if configured, tf
  bool publish_fast(const OdometryReport& report);
  bool publish_cloud(std::span<const CloudMessage::Point> points, Stamp stamp); ///< base frame
  bool publish_map(std::span<const CloudMessage::Point> points, Stamp stamp);   ///< odom frame
  bool publish(const DiagnosticsMessage& diagnostics);
  /// Publishes, latched, the origin of a frame, and how many times the pose was reset so far, modulo 256.
  bool publish_beginning(const DiagnosticsMessage& beginning, std::uint64_t resets);

  /// Returns state and counters. Any thread.
  [[nodiscard]] LinkFigures status() const;
  /// Returns a heartbeat that grows at least ten times a second while the link's thread runs. Any thread.
  [[nodiscard]] std::uint64_t progress() const { return progress_.load(std::memory_order_relaxed); }

 private:
  struct Session;

  void run();
  [[nodiscard]] std::unique_ptr<Session> connect();
  void receive(Session& session);
  void update_status(Session& session);
  [[nodiscard]] Session* session() const { return connected_.load(std::memory_order_acquire); }

  Config config_;
  FrameNames frames_;
  RosNode ros_node_;
  Sink sink_;
  RosCloudSink cloud_sink_;
  CloudMessage cloud_, map_;
  std::unique_ptr<Session> session_;         ///< created by the link's thread
  std::atomic<Session*> connected_{nullptr}; ///< session_ once it is complete
  mutable std::mutex status_mutex_;          ///< never locked by threads of the packet path
  LinkFigures status_;
  std::atomic<std::uint64_t> progress_{0};
  std::atomic<bool> stopping_{false};
  std::thread thread_;
};

} // namespace locus::daemon
