// SPDX-License-Identifier: Apache-2.0
// A Cyclone DDS participant: cyclone_peer DOMAIN listen|talk|iron|humble|command|flood|mistype|clouds|livox|mount
// PREFIX; iron and humble print the discovery of nodes and of DDS endpoints. A listener prints `matched TOPIC` once it
// knows a writer. See peer_words.hpp.
#include <algorithm>
#include <array>
#include <cstdlib>
#include <limits>
#include <set>
#include <stdexcept>
#include <string_view>

#include "daemon/dds/dds_node.hpp"
#include "daemon/dds/ros_messages.hpp"
#include "dds/peer_words.hpp"
#include "dds/room_cloud.hpp"

namespace locus::test {
namespace {

using daemon::DdsNode;
using daemon::DdsReader;
using daemon::DdsWriter;
using daemon::TopicQos;
namespace ros = daemon::ros;

void say(const ros::Odometry& m, const char* topic) {
  const auto& [p, q] = m.pose_.pose_;
  tell("{} {}.{:09} {:.9f} {:.9f} {:.9f} {:.9f} {:.9f} {:.9f} {:.9f} {} {} {:.9g} {:.9g} {}", topic,
       m.header_.stamp_.sec_, m.header_.stamp_.nanosec_, p.x_, p.y_, p.z_, q.x_, q.y_, q.z_, q.w_, m.header_.frame_id_,
       m.child_frame_id_, m.pose_.covariance_[35], m.twist_.twist_.angular_.z_, realtime_ns());
}

void say(const ros::DiagnosticArray& m, const char* topic) {
  for (std::uint32_t i = 0; i < m.status_._length; ++i) {
    const ros::DiagnosticStatus& status = m.status_._buffer[i];
    tell("{} {} {} {}", topic, status.level_, status.values_._length, status.name_);
    tell("{}_message {}: {}", topic, status.name_, status.message_);
  }
}

void listen(const DdsNode& node, const std::string& prefix) {
  constexpr TopicQos kAll{.reliable = true, .depth = 10'000}; // no sample is lost while this process waits for a core
  DdsReader<ros::Odometry> odometry{node, prefix + "/odometry", kAll};
  DdsReader<ros::Odometry> fast{node, prefix + "/odometry_fast", kAll};
  DdsReader<ros::UInt8> state{node, prefix + "/state", kAll};
  DdsReader<ros::TFMessage> tf{node, "/tf", kAll};
  DdsReader<ros::PointCloud2> cloud{node, prefix + "/cloud", TopicQos::standard()}; // QoS as requested by rviz2
  DdsReader<ros::PointCloud2> map{node, prefix + "/map", TopicQos::latch()};
  DdsReader<ros::DiagnosticArray> diagnostics{node, "/diagnostics", TopicQos::standard()};
  DdsReader<ros::DiagnosticArray> beginning{node, prefix + "/beginning", TopicQos::latch()};
  DdsReader<ros::UInt8> resets{node, prefix + "/resets", TopicQos::latch()};
  const auto say_cloud = [](const ros::PointCloud2& m, const char* topic) {
    tell("{} {} {} {} {} {}", topic, m.width_, m.point_step_, m.data_._length, m.fields_._length, m.header_.frame_id_);
  };
  std::set<std::string_view> matched;
  const auto tell_matched = [&](const auto& reader, std::string_view topic) {
    if (reader.writers() > 0 && matched.insert(topic).second)
      tell("matched {}", topic);
  };
  tell("listens");
  constexpr int kRoundsOfALook = 50;
  for (int round = 0; stdin_is_open(); ++round) {
    if (round % kRoundsOfALook == 0) {
      tell_matched(odometry, "odometry");
      tell_matched(fast, "odometry_fast");
      tell_matched(state, "state");
      tell_matched(tf, "tf");
      tell_matched(cloud, "cloud");
      tell_matched(map, "map");
      tell_matched(diagnostics, "diagnostics");
      tell_matched(beginning, "beginning");
    }
    odometry.take([](const ros::Odometry& m) { say(m, "odometry"); });
    fast.take([](const ros::Odometry& m) { say(m, "odometry_fast"); });
    state.take([](const ros::UInt8& m) { tell("state {}", m.data_); });
    tf.take([](const ros::TFMessage& m) {
      for (std::uint32_t i = 0; i < m.transforms_._length; ++i) {
        const ros::TransformStamped& t = m.transforms_._buffer[i];
        tell("tf {} {} {:.9f}", t.header_.frame_id_, t.child_frame_id_, t.transform_.translation_.x_);
      }
    });
    cloud.take([&](const ros::PointCloud2& m) { say_cloud(m, "cloud"); });
    map.take([&](const ros::PointCloud2& m) { say_cloud(m, "map"); });
    diagnostics.take([](const ros::DiagnosticArray& m) { say(m, "diagnostics"); });
    beginning.take([](const ros::DiagnosticArray& m) { say(m, "beginning"); });
    resets.take([](const ros::UInt8& m) { tell("resets {}", m.data_); });
    std::this_thread::sleep_for(std::chrono::microseconds{200});
  }
}

/// Prints the endpoints of other participants, from a built-in topic.
void say_endpoints(dds_entity_t participant, dds_entity_t builtin, const char* kind) {
  dds_guid_t own{};
  dds_get_guid(participant, &own);
  std::array<void*, 32> samples{};
  std::array<dds_sample_info_t, 32> infos{};
  const dds_return_t count = dds_take(builtin, samples.data(), infos.data(), samples.size(), samples.size());
  for (std::size_t i = 0; count > 0 && i < static_cast<std::size_t>(count); ++i) {
    const auto* endpoint = static_cast<const dds_builtintopic_endpoint_t*>(samples[i]);
    if (!infos[i].valid_data || std::ranges::equal(endpoint->participant_key.v, own.v))
      continue;
    void* user_data = nullptr;
    std::size_t size = 0;
    dds_qget_userdata(endpoint->qos, &user_data, &size);
    tell("{} {} {} {} {}", kind, hex(endpoint->key.v), endpoint->topic_name, endpoint->type_name,
         std::string_view(static_cast<const char*>(user_data), size));
    dds_free(user_data);
  }
  if (count > 0)
    dds_return_loan(builtin, samples.data(), count);
}

template <class Info> void hear_nodes(const DdsNode& node) {
  const dds_entity_t participant = node.participant();
  const daemon::DdsEntity readers{dds_create_reader(participant, DDS_BUILTIN_TOPIC_DCPSSUBSCRIPTION, nullptr, nullptr)};
  const daemon::DdsEntity writers{dds_create_reader(participant, DDS_BUILTIN_TOPIC_DCPSPUBLICATION, nullptr, nullptr)};
  DdsReader<Info> infos{node, "ros_discovery_info", TopicQos::latch()};
  const auto say_gids = [](const char* word, const auto& gids) {
    for (std::uint32_t i = 0; i < gids._length; ++i)
      tell("{} {}", word, hex(gids._buffer[i].data_));
  };
  while (stdin_is_open()) {
    say_endpoints(participant, readers.handle(), "reader");
    say_endpoints(participant, writers.handle(), "writer");
    infos.take([&](const Info& info) {
      for (std::uint32_t i = 0; i < info.node_entities_info_seq_._length; ++i) {
        const auto& one = info.node_entities_info_seq_._buffer[i];
        tell("node {} {} {}", one.node_namespace_, one.node_name_, hex(info.gid_.data_));
        say_gids("node_reader", one.reader_gid_seq_);
        say_gids("node_writer", one.writer_gid_seq_);
        tell("node_end {}", one.node_name_);
      }
    });
    std::this_thread::sleep_for(std::chrono::milliseconds{10});
  }
}

void talk(const DdsNode& node) {
  const DdsWriter<ros::Imu> imus{node, "/imu/data", {false, 5}};
  const DdsWriter<ros::Odometry> odometries{node, "/wheel_odometry", TopicQos::standard()};
  const DdsWriter<ros::Bool> healths{node, "/wheel_health", TopicQos::standard()};
  std::string empty;
  talk_on([&](int i) {
    const Said said(i);
    ros::Imu imu{};
    imu.header_ = {{said.sec, said.nanosec}, empty.data()};
    imu.orientation_.w_ = 1;
    imu.angular_velocity_.z_ = said.figure;
    imu.linear_acceleration_.z_ = 9.81;
    ros::Odometry odometry{};
    odometry.header_ = {{said.sec, said.nanosec}, empty.data()};
    odometry.child_frame_id_ = empty.data();
    odometry.pose_.pose_.position_.x_ = said.figure;
    odometry.pose_.pose_.orientation_.w_ = 1;
    odometry.twist_.covariance_[0] = 0.01;
    if (!imus.write(imu) || !odometries.write(odometry) || !healths.write({i % 2 == 0}))
      throw std::runtime_error("DDS did not take a message");
  });
}

/// Publishes only that the ground is not flat.
void command(const DdsNode& node) {
  const DdsWriter<ros::Bool> grounds{node, "/flat_ground", TopicQos::standard()};
  talk_on([&](int /*i*/) {
    if (!grounds.write({false}))
      throw std::runtime_error("DDS did not take a message");
  });
}

/// Publishes absurd samples at the maximum rate, and finally prints their number.
void flood(const DdsNode& node) {
  const DdsWriter<ros::Imu> imus{node, "/imu/data", {false, 5}};
  const DdsWriter<ros::Odometry> odometries{node, "/wheel_odometry", {false, 5}};
  const DdsWriter<ros::Bool> healths{node, "/wheel_health", TopicQos::standard()}; // others are not received
  const DdsWriter<ros::Bool> grounds{node, "/flat_ground", TopicQos::standard()};
  constexpr std::uint32_t kWords = 64; ///< a reliable writer that waits for its readers would slow the flood
  constexpr double kNone = std::numeric_limits<double>::quiet_NaN(), kEndless = std::numeric_limits<double>::infinity();
  constexpr std::array kAbsurd{kNone, kEndless, -kEndless, 1e300, -1e300, 1e-300, 0.0, 1e9};
  std::string empty, large(60'000, 'x');
  std::uint64_t sent = 0;
  for (std::uint32_t i = 0; i % 1024 != 0 || stdin_is_open(); ++i) {
    const double absurd = kAbsurd[i % kAbsurd.size()];
    std::string& frame = i % 100 == 0 ? large : empty;
    const auto now_s = static_cast<std::int32_t>(realtime_ns() / 1'000'000'000);
    const std::array seconds{now_s, 0, std::numeric_limits<std::int32_t>::max(), -1};
    ros::Imu imu{};
    imu.header_ = {{seconds[i / 8 % seconds.size()], i}, frame.data()};
    imu.orientation_.w_ = absurd;
    imu.angular_velocity_.x_ = imu.linear_acceleration_.z_ = absurd;
    ros::Odometry odometry{};
    odometry.header_ = {imu.header_.stamp_, frame.data()};
    odometry.child_frame_id_ = frame.data();
    odometry.pose_.pose_.position_.x_ = odometry.pose_.pose_.orientation_.w_ = absurd;
    odometry.twist_.covariance_[0] = absurd;
    sent += imus.write(imu) ? 1U : 0U;
    sent += odometries.write(odometry) ? 1U : 0U;
    if (i % kWords == 0) {
      sent += healths.write({i % (2 * kWords) == 0}) ? 1U : 0U;
      sent += grounds.write({true}) ? 1U : 0U;
    }
  }
  tell("flooded {}", sent);
}

/// Publishes a room ten times a second, as lidar drivers do.
void talk_of_clouds(const DdsNode& node) {
  const DdsWriter<ros::PointCloud2> clouds{node, "/points", TopicQos::sensor_out()};
  std::vector<std::uint8_t> data = room_cloud::points();
  std::string frame = "lidar";
  std::vector<std::string> names;
  for (const room_cloud::Field& field : room_cloud::kFields)
    names.emplace_back(field.name);
  std::vector<ros::PointField> fields;
  for (std::size_t i = 0; i < names.size(); ++i)
    fields.push_back({names[i].data(), room_cloud::kFields[i].offset, room_cloud::kFields[i].type, 1});
  talk_of_turns([&](std::int32_t sec, std::uint32_t nanosec) {
    ros::PointCloud2 cloud{};
    cloud.header_ = {{sec, nanosec}, frame.data()};
    cloud.height_ = 1;
    cloud.width_ = room_cloud::kPoints;
    cloud.fields_ = {static_cast<std::uint32_t>(fields.size()), static_cast<std::uint32_t>(fields.size()),
                     fields.data(), false};
    cloud.point_step_ = room_cloud::kStep;
    cloud.row_step_ = room_cloud::kStep * room_cloud::kPoints;
    cloud.data_ = {static_cast<std::uint32_t>(data.size()), static_cast<std::uint32_t>(data.size()), data.data(),
                   false};
    if (!clouds.write(cloud))
      throw std::runtime_error("DDS did not take a cloud");
  });
}

/// Publishes the room ten times a second, as Livox' driver does.
void talk_as_livox(const DdsNode& node) {
  const DdsWriter<ros::LivoxCloud> clouds{node, "/points", TopicQos::sensor_out()};
  std::vector<ros::LivoxPoint> points;
  for (const room_cloud::LivoxPoint& point : room_cloud::livox_points())
    points.push_back(
        {point.offset_ns, point.xyz_m[0], point.xyz_m[1], point.xyz_m[2], point.reflectivity, 0, point.line});
  const auto count = static_cast<std::uint32_t>(points.size());
  std::string frame = "lidar";
  talk_of_turns([&](std::int32_t sec, std::uint32_t nanosec) {
    ros::LivoxCloud cloud{};
    cloud.header_ = {{sec, nanosec}, frame.data()};
    cloud.timebase_ = static_cast<std::uint64_t>(sec) * 1'000'000'000 + nanosec;
    cloud.point_num_ = count;
    cloud.points_ = {count, count, points.data(), false};
    if (!clouds.write(cloud))
      throw std::runtime_error("DDS did not take a cloud");
  });
}

/// Publishes once where the lidar of talk_of_clouds() is mounted.
void mount(const DdsNode& node) {
  const DdsWriter<ros::TFMessage> transforms{node, "/tf_static", TopicQos::latch()};
  const daemon::FrameNames frames{"base_link", "lidar"};
  ros::TransformStamped transform =
      daemon::to_ros_transform(Stamp{}, {Eigen::Quaterniond::Identity(), {0.1, 0, 0.75}}, frames);
  if (!transforms.write({{1, 1, &transform, false}}))
    throw std::runtime_error("DDS did not take a transform");
  talk_on([](int /*i*/) {});
}

/// Publishes existing topic names with wrong types.
void mistype(const DdsNode& node) {
  const DdsWriter<ros::UInt8> imus{node, "/imu/data", {false, 5}}, odometries{node, "/wheel_odometry", {false, 5}};
  talk_on([&](int i) {
    if (!imus.write({static_cast<std::uint8_t>(i)}) || !odometries.write({static_cast<std::uint8_t>(i)}))
      throw std::runtime_error("DDS did not take a message");
  });
}

void run(int argc, char** argv) {
  if (argc < 4 || argc > 6)
    throw std::runtime_error(
        "usage: cyclone_peer DOMAIN "
        "listen|talk|iron|humble|command|flood|mistype|clouds|livox|mount PREFIX [INTERFACE [ENCLAVE]]");
  DdsOptions options;
  options.domain = std::atoi(argv[1]); // NOLINT
  if (argc >= 5)
    options.interface = argv[4];
  if (argc == 6)
    options.security = argv[5];
  const auto node = DdsNode::open(options);
  if (!node)
    throw std::runtime_error(node.error());
  const std::string role = argv[2];
  if (role == "talk")
    talk(*node);
  else if (role == "iron")
    hear_nodes<ros::ParticipantEntitiesInfo>(*node);
  else if (role == "humble")
    hear_nodes<ros::HumbleParticipantEntitiesInfo>(*node);
  else if (role == "command")
    command(*node);
  else if (role == "flood")
    flood(*node);
  else if (role == "mistype")
    mistype(*node);
  else if (role == "clouds")
    talk_of_clouds(*node);
  else if (role == "livox")
    talk_as_livox(*node);
  else if (role == "mount")
    mount(*node);
  else
    listen(*node, argv[3]);
}

} // namespace
} // namespace locus::test

int main(int argc, char** argv) {
  try {
    locus::test::run(argc, argv);
  } catch (const std::exception& error) {
    fmt::print(stderr, "cyclone_peer: {}\n", error.what());
    return 1;
  }
  return 0;
}
