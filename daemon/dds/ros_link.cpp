// SPDX-License-Identifier: Apache-2.0
#include "daemon/dds/ros_link.hpp"

#include <algorithm>
#include <ctime>
#include <optional>
#include <utility>

#include <pthread.h>

#include "daemon/dds/cloud_reader.hpp"
#include "daemon/dds/dds_node.hpp"
#include "daemon/dds/publications.hpp"
#include "daemon/machine_time.hpp"

namespace locus::daemon {
namespace {

constexpr Duration kMaxSleep = std::chrono::milliseconds{100}; ///< period of checks of the stop flag
constexpr Duration kFirstRetryDelay = std::chrono::seconds{1}; ///< doubled after each failed attempt
constexpr Duration kMaxRetryDelay = std::chrono::seconds{15};

} // namespace

/// Endpoints that exist while there is a network.
struct RosLink::Session {
  struct ImuSource {
    SourceId source;
    DdsReader<ros::Imu> reader;
    Admission admission;
    std::uint64_t received = 0;
  };
  struct OdometrySource {
    SourceId source;
    DdsReader<ros::Odometry> reader;
    UsualCovariance usual;
    Admission admission;
    std::uint64_t received = 0;
  };
  struct CloudLidar {
    std::uint8_t lidar;
    CloudReader reader;
    Admission admission;
    std::uint64_t received = 0;
  };
  struct HealthTopic {
    SourceId source;
    DdsReader<ros::Bool> reader;
    Admission admission;
  };
  struct FlatGroundTopic {
    DdsReader<ros::Bool> reader;
    Admission admission;
  };

  Session(DdsNode node_, const Config& config, RosNode ros_node_)
      : node(std::move(node_)), ros_node(std::move(ros_node_)), ros_graph(config.dds.ros_graph) {
    const DdsOptions& dds = config.dds;
    odometry = {node, dds.prefix + "/odometry", TopicQos::standard()};
    odometry_fast = {node, dds.prefix + "/odometry_fast", TopicQos::standard()};
    state = {node, dds.prefix + "/state", TopicQos::standard()};
    diagnostics = {node, "/diagnostics", TopicQos::standard()};
    beginning = {node, dds.prefix + "/beginning", TopicQos::latch()};
    resets = {node, dds.prefix + "/resets", TopicQos::latch()};
    if (dds.publish_tf)
      tf.emplace(node, "/tf", TopicQos::transform());
    if (dds.publish_cloud)
      cloud.emplace(node, dds.prefix + "/cloud", TopicQos::cloud());
    if (dds.publish_map)
      map.emplace(node, dds.prefix + "/map", TopicQos::latch());
    listen(config);
    graph = announce(ros_node, node, ros_graph);
  }

  void listen(const Config& config) {
    waitset = DdsEntity{dds_create_waitset(node.participant())};
    idle_condition = DdsEntity{dds_create_guardcondition(node.participant())};
    dds_waitset_attach(waitset.handle(), idle_condition.handle(), 0);
    for (std::size_t i = 0; i < config.lidars.size(); ++i) {
      if (config.lidars[i].gives_clouds())
        attach(cloud_lidars
                   .emplace_back(CloudLidar{
                       static_cast<std::uint8_t>(i), {node, config.lidars[i].topic, TopicQos::cloud_in()}, {}})
                   .reader.handle());
    }
    if (!cloud_lidars.empty())
      attach(publications.emplace(node).handle());
    for (std::size_t i = 0; i < config.motion_sources.size(); ++i) {
      const MotionSource& source = config.motion_sources[i];
      if (!source.topic.empty() && source.kind == SourceKind::imu)
        attach(
            imus.emplace_back(ImuSource{SourceId{i}, {node, source.topic, TopicQos::sensor_in()}, {}}).reader.handle());
      else if (!source.topic.empty())
        attach(odometries.emplace_back(OdometrySource{SourceId{i}, {node, source.topic, TopicQos::sensor_in()}, {}, {}})
                   .reader.handle());
      if (!source.health_topic.empty())
        attach(
            health_topics.emplace_back(HealthTopic{SourceId{i}, {node, source.health_topic, TopicQos::standard()}, {}})
                .reader.handle());
    }
    if (!config.dds.flat_ground_topic.empty())
      attach(flat_ground.emplace(FlatGroundTopic{{node, config.dds.flat_ground_topic, TopicQos::standard()}, {}})
                 .reader.handle());
  }

  void attach(dds_entity_t reader) const {
    dds_set_status_mask(reader, DDS_DATA_AVAILABLE_STATUS);
    dds_waitset_attach(waitset.handle(), reader, 0);
  }

  /// Changes the type of the clouds on a topic to the one that is published.
  void follow_publications() {
    if (!publications)
      return;
    publications->take([this](const std::string& topic, std::string_view type) {
      for (CloudLidar& lidar : cloud_lidars)
        lidar.reader.discover(topic, type);
    });
    for (CloudLidar& lidar : cloud_lidars)
      if (lidar.reader.follow(node)) {
        attach(lidar.reader.handle());
        graph = announce(ros_node, node, ros_graph);
      }
  }

  DdsNode node; ///< first member: outlives its endpoints
  RosNode ros_node;
  RosGraph ros_graph;
  DdsWriter<ros::Odometry> odometry, odometry_fast;
  DdsWriter<ros::UInt8> state, resets;
  DdsWriter<ros::DiagnosticArray> diagnostics, beginning;
  std::optional<DdsWriter<ros::TFMessage>> tf;
  std::optional<DdsWriter<ros::PointCloud2>> cloud, map;
  DdsEntity idle_condition; ///< never triggered; a waitset without conditions would return at once
  DdsEntity waitset;
  std::vector<ImuSource> imus;
  std::vector<OdometrySource> odometries;
  std::vector<CloudLidar> cloud_lidars;
  std::optional<Publications> publications; ///< if there are such lidars
  std::vector<HealthTopic> health_topics;
  std::optional<FlatGroundTopic> flat_ground;
  DdsEntity graph;
};

RosLink::RosLink(const Config& config, Sink sink, std::string_view instance, RosCloudSink cloud_sink)
    : config_(config), frames_{config.dds.frame_odom, config.dds.frame_base},
      ros_node_(ros_node(config.dds.prefix, instance)), sink_(std::move(sink)), cloud_sink_(std::move(cloud_sink)) {
  status_.sources.resize(config.motion_sources.size());
  status_.lidars.resize(config.lidars.size());
  thread_ = std::thread([this] { run(); });
  pthread_setname_np(thread_.native_handle(), "dds");
}

RosLink::~RosLink() {
  stopping_.store(true, std::memory_order_relaxed);
  thread_.join();
}

void RosLink::run() {
  session_ = connect();
  if (!session_)
    return;
  connected_.store(session_.get(), std::memory_order_release);
  std::array<dds_attach_t, 1> triggered{};
  Duration status_updated_at{};
  while (!stopping_.load(std::memory_order_relaxed)) {
    progress_.fetch_add(1, std::memory_order_relaxed);
    const bool was_idle =
        dds_waitset_wait(session_->waitset.handle(), triggered.data(), triggered.size(), kMaxSleep.count()) == 0;
    receive(*session_);
    if (const Duration now = read_clock(CLOCK_MONOTONIC); was_idle || now - status_updated_at >= kMaxSleep) {
      update_status(*session_);
      status_updated_at = now;
    }
  }
}

/// Connects, with retries; returns null when the link is to stop.
std::unique_ptr<RosLink::Session> RosLink::connect() {
  Duration delay = kFirstRetryDelay;
  Duration next_attempt{};
  while (!stopping_.load(std::memory_order_relaxed)) {
    progress_.fetch_add(1, std::memory_order_relaxed);
    if (read_clock(CLOCK_MONOTONIC) < next_attempt) {
      std::this_thread::sleep_for(kMaxSleep);
      continue;
    }
    auto node = DdsNode::open(config_.dds);
    const std::scoped_lock lock(status_mutex_);
    ++status_.attempts;
    status_.connected = node.has_value();
    if (node)
      return std::make_unique<Session>(std::move(*node), config_, ros_node_);
    status_.problem = node.error();
    next_attempt = read_clock(CLOCK_MONOTONIC) + delay;
    delay = std::min(2 * delay, kMaxRetryDelay);
  }
  return nullptr;
}

void RosLink::receive(Session& session) {
  session.follow_publications();
  const Stamp arrival{read_clock(CLOCK_REALTIME)};
  const Duration now = read_clock(CLOCK_MONOTONIC);
  for (auto& from : session.imus)
    from.reader.take([&](const ros::Imu& message, dds_instance_handle_t writer) {
      ++from.received;
      if (from.admission.admits(writer, now))
        sink_(ImuInput{from.source, to_sample(message, arrival)});
    });
  for (auto& from : session.odometries)
    from.reader.take([&](const ros::Odometry& message, dds_instance_handle_t writer) {
      ++from.received;
      if (from.admission.admits(writer, now))
        sink_(OdometryInput{from.source, to_sample(message, arrival, from.usual)});
    });
  for (auto& from : session.cloud_lidars)
    from.reader.take_serialised([&](const SerialisedSample& cloud, dds_instance_handle_t writer) {
      ++from.received;
      if (from.admission.admits(writer, now)) // may have arrived while the samples above were handled
        cloud_sink_(from.lidar, Stamp{read_clock(CLOCK_REALTIME)}, from.reader.type(), cloud);
    });
  for (auto& from : session.health_topics)
    from.reader.take([&](const ros::Bool& message, dds_instance_handle_t writer) {
      if (from.admission.admits(writer, now))
        sink_(ExternalHealth{from.source, message.data_});
    });
  if (auto& from = session.flat_ground)
    from->reader.take([&](const ros::Bool& message, dds_instance_handle_t writer) {
      if (from->admission.admits(writer, now))
        sink_(FlatGroundMessage{message.data_});
    });
}

void RosLink::update_status(Session& session) {
  const std::scoped_lock lock(status_mutex_);
  const auto update = [this](auto& sources) {
    for (auto& from : sources) {
      from.admission.update_owner(from.reader);
      status_.sources[index_of(from.source)] = {from.reader.writers(), from.received, from.admission.refused(), 0};
    }
  };
  for (auto& from : session.cloud_lidars) {
    from.admission.update_owner(from.reader);
    status_.lidars[from.lidar] = {from.reader.writers(), from.received, from.admission.refused(), 0};
  }
  update(session.imus);
  update(session.odometries);
  for (auto& from : session.health_topics) {
    from.admission.update_owner(from.reader);
    status_.sources[index_of(from.source)].health_refused = from.admission.refused();
  }
  if (auto& from = session.flat_ground) {
    from->admission.update_owner(from->reader);
    status_.flat_ground_refused = from->admission.refused();
  }
}

bool RosLink::publish(const OdometryReport& report, TrackingState state) {
  Session* const to = session();
  if (to == nullptr)
    return false;
  const bool odometry_sent = to->odometry.write(to_ros(report, frames_));
  const bool state_sent = to->state.write(to_ros(state));
  if (!to->tf)
    return odometry_sent && state_sent;
  ros::TransformStamped transform = to_ros_transform(report.stamp, report.T_odom_base, frames_);
  return to->tf->write({{1, 1, &transform, false}}) && odometry_sent && state_sent;
}

bool RosLink::publish_fast(const OdometryReport& report) {
  Session* const to = session();
  return to != nullptr && to->odometry_fast.write(to_ros(report, frames_));
}

bool RosLink::publish_cloud(std::span<const CloudMessage::Point> points, Stamp stamp) {
  Session* const to = session();
  return to != nullptr && to->cloud && to->cloud->write(cloud_.make(points, stamp, frames_.base));
}

bool RosLink::publish_map(std::span<const CloudMessage::Point> points, Stamp stamp) {
  Session* const to = session();
  return to != nullptr && to->map && to->map->write(map_.make(points, stamp, frames_.odom));
}

bool RosLink::publish(const DiagnosticsMessage& diagnostics) {
  Session* const to = session();
  return to != nullptr && to->diagnostics.write(diagnostics.message());
}

bool RosLink::publish_beginning(const DiagnosticsMessage& beginning, std::uint64_t resets) {
  Session* const to = session();
  return to != nullptr && to->resets.write({static_cast<std::uint8_t>(resets)}) &&
         to->beginning.write(beginning.message());
}

LinkFigures RosLink::status() const {
  const std::scoped_lock lock(status_mutex_);
  return status_;
}

} // namespace locus::daemon
