// SPDX-License-Identifier: Apache-2.0
#include "locus_replay/mcap_inputs.hpp"

#include <fstream>
#include <iterator>
#include <span>
#include <variant>

#include "bags/packet_types.hpp"
#include "locus_replay/motion_messages.hpp"

namespace locus::tools {
namespace {

namespace ros = daemon::ros;

/// Casts for members of C types; the messages are only read.
char* text_of(const std::string& text) {
  return const_cast<char*>(text.c_str()); // NOLINT(cppcoreguidelines-pro-type-const-cast)
}
std::uint8_t* bytes_of(std::span<const std::byte> bytes) {
  return reinterpret_cast<std::uint8_t*>(const_cast<std::byte*>(bytes.data())); // NOLINT
}

template <class Sequence> Sequence sequence_of(std::span<const std::byte> bytes) {
  const auto count = static_cast<std::uint32_t>(bytes.size());
  return {count, count, bytes_of(bytes), false};
}

std::string metadata_text_of(const LidarOptions& options) {
  if (!options.metadata_text.empty())
    return options.metadata_text;
  std::ifstream file{options.metadata, std::ios::binary};
  return {std::istreambuf_iterator<char>{file}, {}};
}

} // namespace

McapInputs::McapInputs(McapMessages& messages, const Config& config)
    : messages_(messages), config_(config), frames_{config.dds.frame_odom, config.dds.frame_base} {
  for (const LidarOptions& lidar : config.lidars) {
    const std::string prefix = "/" + lidar.name;
    const std::string packets = prefix + (lidar.is_ouster() ? "/lidar_packets" : "/packets");
    lidars_.push_back(
        {{lidar.gives_clouds() ? lidar.topic : packets}, {prefix + "/imu_packets"}, {prefix + "/metadata"}});
  }
  for (const MotionSource& source : config.motion_sources)
    sources_.push_back({source.topic.empty() ? "/" + source.name : source.topic});
}

template <class Message> void McapInputs::write(Topic& topic, Stamp stamp, const Message& message) {
  if (!topic.channel)
    topic.channel = messages_.add_topic<Message>(topic.name);
  messages_.write(*topic.channel, stamp, message);
}

void McapInputs::add(const daemon::Input& input, const LidarRouter& lidars) {
  if (const auto* datagram = std::get_if<Datagram>(&input))
    add_datagram(*datagram, lidars);
  else if (const auto* cloud = std::get_if<daemon::CloudInput>(&input))
    add_cloud(*cloud);
  else if (const auto* imu = std::get_if<daemon::ImuInput>(&input))
    add_imu(*imu);
  else if (const auto* odometry = std::get_if<daemon::OdometryInput>(&input))
    add_odometry(*odometry);
  else if (std::holds_alternative<daemon::EndOfInput>(input))
    for (std::size_t i = 0; i < lidars_.size(); ++i)
      write_waiting(i);
}

void McapInputs::add_datagram(const Datagram& datagram, const LidarRouter& lidars) {
  const std::optional<std::size_t> index = lidars.latest();
  if (!index || datagram.truncated || datagram.decoded != nullptr)
    return;
  if (lidars.lidars()[*index].sender().ip().value_or(datagram.source_ip) != datagram.source_ip)
    return;
  if (config_.lidars[*index].is_ouster())
    add_ouster_packet(datagram, *index);
  else
    add_packet(datagram, *index);
}

void McapInputs::add_packet(const Datagram& datagram, std::size_t index) {
  constexpr Duration kSpan = std::chrono::milliseconds{100};
  constexpr std::size_t kMaxPackets = 10'000;
  Lidar& lidar = lidars_[index];
  if (!lidar.waiting.empty() && (std::chrono::abs(datagram.receive_stamp - lidar.waiting.front().stamp) >= kSpan ||
                                 lidar.waiting.size() >= kMaxPackets))
    write_waiting(index);
  lidar.waiting.push_back({datagram.receive_stamp, datagram.payload.size()});
  lidar.payloads.insert(lidar.payloads.end(), datagram.payload.begin(), datagram.payload.end());
}

void McapInputs::write_waiting(std::size_t index) {
  Lidar& lidar = lidars_[index];
  const LidarOptions& options = config_.lidars[index];
  if (lidar.waiting.empty())
    return;
  const Stamp last = lidar.waiting.back().stamp;
  if (!lidar.packets.channel)
    write_mounting(last, options.name, options.T_base_lidar);
  std::vector<ros::NebulaPacket> packets;
  std::span<const std::byte> rest = lidar.payloads;
  for (const Lidar::Packet& packet : lidar.waiting) {
    using Payload = decltype(ros::NebulaPacket::data_);
    packets.push_back({daemon::to_ros(packet.stamp), sequence_of<Payload>(rest.first(packet.bytes))});
    rest = rest.subspan(packet.bytes);
  }
  const auto count = static_cast<std::uint32_t>(packets.size());
  write(lidar.packets, last,
        ros::NebulaPackets{{daemon::to_ros(last), text_of(options.name)}, {count, count, packets.data(), false}});
  lidar.waiting.clear();
  lidar.payloads.clear();
}

void McapInputs::add_ouster_packet(const Datagram& datagram, std::size_t index) {
  Lidar& lidar = lidars_[index];
  const LidarOptions& options = config_.lidars[index];
  if (!lidar.metadata.channel) {
    write_mounting(datagram.receive_stamp, options.name, options.T_base_lidar);
    const std::string text = metadata_text_of(options);
    write(lidar.metadata, datagram.receive_stamp, ros::String{text_of(text)});
  }
  const bool is_imu = datagram.destination_port != options.port;
  write(is_imu ? lidar.imu_packets : lidar.packets, datagram.receive_stamp,
        ros::OusterPacket{sequence_of<decltype(ros::OusterPacket::buf_)>(datagram.payload)});
}

void McapInputs::add_cloud(const daemon::CloudInput& cloud) {
  if (cloud.message == nullptr)
    return;
  const CloudView& view = *cloud.message;
  const std::string frame{view.frame};
  Topic& topic = lidars_[cloud.lidar].packets;
  if (!topic.channel)
    write_mounting(cloud.arrival, frame, config_.lidars[cloud.lidar].T_base_lidar);
  std::vector<std::string> names;
  for (const CloudView::Field& field : view.fields())
    names.emplace_back(field.name);
  std::vector<ros::PointField> fields;
  for (std::size_t i = 0; i < names.size(); ++i) {
    const CloudView::Field& field = view.fields()[i];
    fields.push_back({text_of(names[i]), field.offset, static_cast<std::uint8_t>(field.type), 1});
  }
  const auto count = static_cast<std::uint32_t>(fields.size());
  ros::PointCloud2 message{};
  message.header_ = {daemon::to_ros(view.stamp - view.ahead), text_of(frame)};
  message.height_ = view.height;
  message.width_ = view.width;
  message.fields_ = {count, count, fields.data(), false};
  message.is_bigendian_ = view.is_big_endian;
  message.point_step_ = view.point_step;
  message.row_step_ = view.row_step;
  message.data_ = sequence_of<decltype(message.data_)>(view.data);
  write(topic, cloud.arrival, message);
}

void McapInputs::add_imu(const daemon::ImuInput& imu) {
  const MotionSource& source = config_.motion_sources[index_of(imu.source)];
  Topic& topic = sources_[index_of(imu.source)];
  if (!topic.channel)
    write_mounting(imu.sample.arrival, source.name, source.T_base_source);
  write(topic, imu.sample.arrival, to_ros(imu.sample, source.name));
}

void McapInputs::add_odometry(const daemon::OdometryInput& odometry) {
  write(sources_[index_of(odometry.source)], odometry.sample.arrival, to_ros(odometry.sample, frames_));
}

/// Does nothing for clouds that are in the base frame already, or in none.
void McapInputs::write_mounting(Stamp stamp, const std::string& frame, const Pose& T_base_sensor) {
  if (frame.empty() || frame == frames_.base)
    return;
  const daemon::FrameNames names{frames_.base, frame};
  ros::TransformStamped transform = daemon::to_ros_transform(stamp, T_base_sensor, names);
  write(static_tf_, stamp, ros::TFMessage{{1, 1, &transform, false}});
}

} // namespace locus::tools
