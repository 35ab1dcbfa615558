// SPDX-License-Identifier: Apache-2.0
#include "bag_writer.hpp"

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstring>
#include <map>
#include <memory>
#include <stdexcept>
#include <utility>

#include <gtest/gtest.h>
#include <sqlite3.h>

#include "dds/fast_dds_types.hpp"
#include "drivers/files/capture.hpp"
#include "drivers/files/motion_files.hpp"
#include "drivers/velodyne/model.hpp"

namespace locus::test {
namespace {

struct FastPacket {
  std::int32_t sec = 0;
  std::uint32_t nanosec = 0;
  std::array<std::uint8_t, velodyne::kDataPacketBytes> data{};
  template <class Stream> void fields(Stream& s) { s(sec)(nanosec)(data); }
};

struct FastNebulaPacket {
  std::int32_t sec = 0;
  std::uint32_t nanosec = 0;
  std::vector<std::uint8_t> data{};
  template <class Stream> void fields(Stream& s) { s(sec)(nanosec)(data); }
};

struct FastPandarPacket {
  std::int32_t sec = 0;
  std::uint32_t nanosec = 0;
  std::array<std::uint8_t, 1500> data{};
  std::uint32_t size = 0;
  template <class Stream> void fields(Stream& s) { s(sec)(nanosec)(data)(size); }
};

struct FastHesaiPacket {
  std::int32_t sec = 0;
  std::uint32_t nanosec = 0;
  std::vector<std::uint8_t> data{};
  std::uint32_t size = 0;
  template <class Stream> void fields(Stream& s) { s(sec)(nanosec)(data)(size); }
};

struct FastHesaiPacketWithHeader {
  FastHeader header;
  FastHesaiPacket packet;
  template <class Stream> void fields(Stream& s) { s(header)(packet); }
};

struct FastFrameWithoutHeader {
  std::vector<FastHesaiPacketWithHeader> packets;
  template <class Stream> void fields(Stream& s) { s(packets); }
};

template <class Packet> struct FastScan {
  FastHeader header;
  std::vector<Packet> packets;
  template <class Stream> void fields(Stream& s) { s(header)(packets); }
};

/// Serialises members as ROS 1 does.
class Ros1Stream {
 public:
  explicit Ros1Stream(std::string& out) : out_(out) {}

  template <class T> Ros1Stream& operator()(T& value) {
    if constexpr (std::is_arithmetic_v<T>)
      out_.append(reinterpret_cast<const char*>(&value), sizeof(value));
    else
      value.fields(*this);
    return *this;
  }
  template <class T, std::size_t n> Ros1Stream& operator()(std::array<T, n>& values) {
    return append(std::span<T>{values});
  }
  template <class T> Ros1Stream& operator()(std::vector<T>& values) {
    auto count = static_cast<std::uint32_t>(values.size());
    return (*this)(count).append(std::span<T>{values});
  }
  Ros1Stream& operator()(std::string& text) {
    auto count = static_cast<std::uint32_t>(text.size());
    (*this)(count);
    out_ += text;
    return *this;
  }
  Ros1Stream& operator()(FastHeader& header) {
    std::uint32_t sequence = 7;
    (*this)(sequence);
    header.fields(*this);
    return *this;
  }

 private:
  template <class T> Ros1Stream& append(std::span<T> values) {
    if constexpr (std::is_arithmetic_v<T>)
      out_.append(reinterpret_cast<const char*>(values.data()), values.size_bytes());
    else
      for (T& value : values)
        (*this)(value);
    return *this;
  }

  std::string& out_;
};

std::vector<std::byte> to_bytes(std::string_view text) {
  const auto bytes = std::as_bytes(std::span{text});
  return {bytes.begin(), bytes.end()};
}

template <class Message>
std::vector<std::byte> serialised(Message message, RosVersion ros, std::size_t most_bytes = 1 << 20) {
  if (ros == RosVersion::ros1) {
    std::string out;
    Ros1Stream stream(out);
    stream(message);
    return to_bytes(out);
  }
  static std::string out; // reused: allocating a megabyte per IMU sample would dominate the run time
  out.resize(std::max(out.size(), most_bytes));
  eprosima::fastcdr::FastBuffer buffer(out.data(), out.size());
  eprosima::fastcdr::Cdr cdr(buffer, eprosima::fastcdr::Cdr::LITTLE_ENDIANNESS, eprosima::fastcdr::Cdr::DDS_CDR);
  cdr.serialize_encapsulation();
  FastStream<false> stream(cdr);
  stream(message);
  return to_bytes(std::string_view(out).substr(0, cdr.getSerializedDataLength()));
}

std::int32_t seconds_of(Stamp stamp) { return static_cast<std::int32_t>(to_ns(stamp) / 1'000'000'000); }
std::uint32_t nanoseconds_of(Stamp stamp) { return static_cast<std::uint32_t>(to_ns(stamp) % 1'000'000'000); }
FastHeader header_at(Stamp stamp, std::string frame) {
  return {seconds_of(stamp), nanoseconds_of(stamp), std::move(frame)};
}

template <class Number> std::string raw(Number value) { return {reinterpret_cast<const char*>(&value), sizeof(value)}; }
std::string block(const std::string& content) { return raw(static_cast<std::uint32_t>(content.size())) + content; }
std::string field(const std::string& name, const std::string& value) { return block(name + "=" + value); }
std::string op(int code) { return field("op", std::string(1, static_cast<char>(code))); }
std::string record(const std::string& header, const std::string& data) { return block(header) + block(data); }

std::string connection_record(std::uint32_t id, const RecordedMessage& first) {
  return record(op(7) + field("conn", raw(id)) + field("topic", first.topic),
                field("topic", first.topic) + field("type", first.type) + field("md5sum", std::string(32, '0')) +
                    field("message_definition", "none"));
}

std::string message_record(std::uint32_t id, const RecordedMessage& message) {
  const std::string time = raw(seconds_of(message.recorded)) + raw(nanoseconds_of(message.recorded));
  return record(op(2) + field("conn", raw(id)) + field("time", time),
                {reinterpret_cast<const char*>(message.data.data()), message.data.size()});
}

std::string chunk_record(const std::string& content) {
  return record(op(5) + field("compression", "none") + field("size", raw(static_cast<std::uint32_t>(content.size()))),
                content);
}

/// Padded to a length that is independent of the index' position.
std::string bag_header(std::uint64_t index, std::uint32_t connections, std::uint32_t chunks) {
  return record(op(3) + field("index_pos", raw(index)) + field("conn_count", raw(connections)) +
                    field("chunk_count", raw(chunks)),
                std::string(4000, ' '));
}

} // namespace

std::vector<std::byte> imu_message(const ImuSample& sample, RosVersion ros) {
  FastImu imu;
  imu.header = header_at(sample.stamp, "imu_link");
  if (sample.attitude)
    imu.orientation_xyzw = {sample.attitude->x(), sample.attitude->y(), sample.attitude->z(), sample.attitude->w()};
  else
    imu.orientation_covariance[0] = -1;
  std::copy_n(sample.angular_velocity_radps.data(), 3, imu.angular_velocity.begin());
  std::copy_n(sample.specific_force_mps2.data(), 3, imu.linear_acceleration.begin());
  return serialised(imu, ros);
}

std::vector<std::byte> odometry_message(const OdometrySample& sample, RosVersion ros) {
  const Eigen::Vector3d& p = sample.T_source_base.translation;
  const Eigen::Quaterniond& q = sample.T_source_base.rotation;
  FastOdometry odometry;
  odometry.header = header_at(sample.stamp, "odom");
  odometry.child_frame_id = "base_link";
  odometry.pose.xyz_xyzw = {p.x(), p.y(), p.z(), q.x(), q.y(), q.z(), q.w()};
  return serialised(odometry, ros);
}

std::vector<std::byte> scan_message(std::span<const ReceivedPacket> packets, RosVersion ros) {
  FastScan<FastPacket> scan{header_at(packets.empty() ? Stamp{} : packets.back().stamp, "velodyne"), {}};
  for (const ReceivedPacket& packet : packets) {
    FastPacket& fast = scan.packets.emplace_back();
    fast.sec = seconds_of(packet.stamp);
    fast.nanosec = nanoseconds_of(packet.stamp);
    std::memcpy(fast.data.data(), packet.payload.data(), fast.data.size());
  }
  return serialised(scan, ros);
}

std::vector<std::byte> nebula_message(std::span<const ReceivedPacket> packets, RosVersion ros) {
  FastScan<FastNebulaPacket> scan{header_at(packets.empty() ? Stamp{} : packets.back().stamp, "velodyne"), {}};
  for (const ReceivedPacket& packet : packets) {
    const auto* const begin = reinterpret_cast<const std::uint8_t*>(packet.payload.data());
    scan.packets.push_back(
        {seconds_of(packet.stamp), nanoseconds_of(packet.stamp), {begin, begin + packet.payload.size()}});
  }
  return serialised(scan, ros);
}

std::vector<std::byte> pandar_message(std::span<const ReceivedPacket> packets, RosVersion ros) {
  FastScan<FastPandarPacket> scan{header_at(packets.empty() ? Stamp{} : packets.back().stamp, "hesai"), {}};
  for (const ReceivedPacket& packet : packets) {
    FastPandarPacket& one = scan.packets.emplace_back();
    one.sec = seconds_of(packet.stamp);
    one.nanosec = nanoseconds_of(packet.stamp);
    one.size = static_cast<std::uint32_t>(packet.payload.size());
    std::memcpy(one.data.data(), packet.payload.data(), packet.payload.size());
  }
  return serialised(scan, ros);
}

std::vector<std::byte> hesai_message(std::span<const ReceivedPacket> packets, RosVersion ros, HesaiHeaders headers) {
  const FastHeader header = header_at(packets.empty() ? Stamp{} : packets.back().stamp, "hesai");
  FastScan<FastHesaiPacket> frame{header, {}};
  FastFrameWithoutHeader bare;
  for (const ReceivedPacket& packet : packets) {
    const auto* const begin = reinterpret_cast<const std::uint8_t*>(packet.payload.data());
    frame.packets.push_back({seconds_of(packet.stamp),
                             nanoseconds_of(packet.stamp),
                             {begin, begin + packet.payload.size()},
                             static_cast<std::uint32_t>(packet.payload.size())});
    bare.packets.push_back({header, frame.packets.back()});
  }
  return headers == HesaiHeaders::of_frame ? serialised(frame, ros) : serialised(bare, ros);
}

std::string type_of(const OwnCloud& cloud) {
  return std::string{cloud.fields.front().name == "offset_time" ? "livox_ros_driver2/CustomMsg" : kPointCloudType};
}

std::vector<std::byte> cloud_message(const OwnCloud& cloud, RosVersion ros) {
  const std::size_t most_bytes = cloud.data.size() + 100'000;
  if (is_livox_type(type_of(cloud))) {
    FastLivoxCloud livox{
        header_at(cloud.stamp, cloud.frame), static_cast<std::uint64_t>(to_ns(cloud.stamp)), cloud.width, 0, {}, {}};
    for (std::size_t i = 0; i < cloud.width; ++i)
      livox.points.push_back({cloud.get<std::uint32_t>(i, "offset_time"),
                              {cloud.get<float>(i, "x"), cloud.get<float>(i, "y"), cloud.get<float>(i, "z")},
                              cloud.get<std::uint8_t>(i, "reflectivity"),
                              16,
                              cloud.get<std::uint8_t>(i, "line")});
    return serialised(livox, ros, most_bytes);
  }
  FastCloud fast{header_at(cloud.stamp, cloud.frame), cloud.height, cloud.width, {}, false, cloud.point_step,
                 cloud.width * cloud.point_step,      {},           true};
  for (const OwnCloud::Field& field : cloud.fields)
    fast.point_fields.push_back({field.name, field.offset, static_cast<std::uint8_t>(field.type), 1});
  fast.data.resize(cloud.data.size());
  std::memcpy(fast.data.data(), cloud.data.data(), cloud.data.size());
  return serialised(fast, ros, most_bytes);
}

std::vector<std::byte> transform_message(const std::string& parent, const std::string& child, const Pose& T,
                                         RosVersion ros) {
  const Eigen::Vector3d& p = T.translation;
  const Eigen::Quaterniond& q = T.rotation;
  FastTransforms transforms;
  transforms.transforms.push_back(
      {header_at(Stamp{}, parent), child, {{p.x(), p.y(), p.z(), q.x(), q.y(), q.z(), q.w()}}});
  return serialised(transforms, ros);
}

std::string ros1_bag(std::span<const RecordedMessage> messages, BagEnd end) {
  constexpr std::size_t kMessagesInChunk = 10;
  std::map<std::string, std::uint32_t> connections;
  std::string index, body, chunk;
  std::uint32_t chunks = 0;
  for (std::size_t i = 0; i < messages.size(); ++i) {
    const auto [connection, is_new] =
        connections.try_emplace(messages[i].topic, static_cast<std::uint32_t>(connections.size()));
    if (is_new) {
      index += connection_record(connection->second, messages[i]);
      chunk += connection_record(connection->second, messages[i]);
    }
    chunk += message_record(connection->second, messages[i]);
    if ((i + 1) % kMessagesInChunk == 0 || i + 1 == messages.size()) {
      body += chunk_record(std::exchange(chunk, {})) + record(op(4) + field("ver", raw(std::uint32_t{1})), "");
      ++chunks;
    }
  }
  const std::string magic = "#ROSBAG V2.0\n";
  const auto count = static_cast<std::uint32_t>(connections.size());
  if (end == BagEnd::without_index)
    return magic + bag_header(0, 0, 0) + body;
  const std::uint64_t index_at = magic.size() + bag_header(0, 0, 0).size() + body.size();
  return magic + bag_header(index_at, count, chunks) + body + index + record(op(6), "chunk info");
}

void write_db3(const std::filesystem::path& file, std::span<const RecordedMessage> messages,
               const std::string& serialisation) {
  sqlite3* opened = nullptr;
  if (sqlite3_open(file.c_str(), &opened) != SQLITE_OK)
    throw std::runtime_error("cannot make " + file.string());
  const std::unique_ptr<sqlite3, decltype([](sqlite3* d) { sqlite3_close(d); })> database(opened);
  const auto run = [&](const char* sql) { ASSERT_EQ(sqlite3_exec(opened, sql, nullptr, nullptr, nullptr), SQLITE_OK); };
  const auto insert = [&](const char* sql, const auto& bind) {
    sqlite3_stmt* statement = nullptr;
    ASSERT_EQ(sqlite3_prepare_v2(opened, sql, -1, &statement, nullptr), SQLITE_OK);
    bind(statement);
    EXPECT_EQ(sqlite3_step(statement), SQLITE_DONE);
    sqlite3_finalize(statement);
  };
  const auto bind_text = [](sqlite3_stmt* to, int place, const std::string& text) {
    sqlite3_bind_text(to, place, text.c_str(), -1, SQLITE_TRANSIENT);
  };
  run("CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT NOT NULL, type TEXT NOT NULL, serialization_format TEXT "
      "NOT NULL, offered_qos_profiles TEXT NOT NULL);"
      "CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER NOT NULL, timestamp INTEGER NOT NULL, data BLOB "
      "NOT NULL);"
      "CREATE INDEX timestamp_idx ON messages (timestamp ASC); BEGIN");
  std::map<std::string, int> topics;
  for (const RecordedMessage& message : messages) {
    const auto [topic, is_new] = topics.try_emplace(message.topic, static_cast<int>(topics.size()) + 1);
    if (is_new)
      insert("INSERT INTO topics VALUES (NULL, ?, ?, ?, '')", [&](sqlite3_stmt* row) {
        std::string type = message.type;
        bind_text(row, 1, message.topic);
        bind_text(row, 2, type.insert(type.find('/'), "/msg"));
        bind_text(row, 3, serialisation);
      });
    insert("INSERT INTO messages VALUES (NULL, ?, ?, ?)", [&, id = topic->second](sqlite3_stmt* row) {
      sqlite3_bind_int(row, 1, id);
      sqlite3_bind_int64(row, 2, to_ns(message.recorded));
      sqlite3_bind_blob(row, 3, message.data.data(), static_cast<int>(message.data.size()), SQLITE_TRANSIENT);
    });
  }
  run("COMMIT");
}

std::vector<RecordedMessage> messages_of(const std::filesystem::path& capture_folder, RosVersion ros,
                                         decltype(scan_message)& packet_message) {
  constexpr std::size_t kPacketsInTurn = 76;
  std::vector<RecordedMessage> messages;
  std::map<std::uint16_t, std::vector<ReceivedPacket>> turns;
  const auto finish = [&](std::uint16_t port, std::vector<ReceivedPacket>& turn) {
    messages.push_back({"/" + std::to_string(port) + "/velodyne_packets", "velodyne_msgs/VelodyneScan",
                        turn.back().stamp, packet_message(turn, ros)});
    turn.clear();
  };
  auto capture = Capture::open(capture_folder / "lidar.pcap");
  while (const Datagram* datagram = capture->next()) {
    if (datagram->payload.size() != velodyne::kDataPacketBytes)
      continue;
    std::vector<ReceivedPacket>& turn = turns[datagram->destination_port];
    turn.push_back({datagram->receive_stamp, {datagram->payload.begin(), datagram->payload.end()}});
    if (turn.size() == kPacketsInTurn)
      finish(datagram->destination_port, turn);
  }
  for (auto& [port, turn] : turns) {
    if (!turn.empty())
      finish(port, turn);
  }
  auto imu = MotionSamples<ImuSample>::open(capture_folder / "imu.csv");
  for (const ImuSample& sample : imu->drain())
    messages.push_back({"/imu/data", "sensor_msgs/Imu", sample.arrival, imu_message(sample, ros)});
  for (const auto& [file, topic] :
       {std::pair{"wio.tum", "/wheel_odometry"}, {"vio.tum", "/visual_odometry"}, {"kio.tum", "/kinematic_odometry"}}) {
    if (auto odometry = MotionSamples<OdometrySample>::open(capture_folder / file))
      for (const OdometrySample& sample : odometry->drain())
        messages.push_back({topic, "nav_msgs/Odometry", sample.arrival, odometry_message(sample, ros)});
  }
  std::ranges::stable_sort(messages, {}, &RecordedMessage::recorded);
  return messages;
}

std::vector<RecordedMessage> messages_of(const std::filesystem::path& capture_folder, std::span<const OwnCloud> clouds,
                                         std::span<const Stamp> ends, RosVersion ros) {
  constexpr Duration kWay = std::chrono::milliseconds{4};
  std::vector<RecordedMessage> messages = messages_of(capture_folder, ros);
  std::erase_if(messages, [](const RecordedMessage& message) { return message.topic.ends_with("packets"); });
  for (std::size_t i = 0; i < clouds.size(); ++i)
    messages.push_back({"/points", type_of(clouds[i]), ends[i] + kWay, cloud_message(clouds[i], ros)});
  std::ranges::stable_sort(messages, {}, &RecordedMessage::recorded);
  return messages;
}

} // namespace locus::test
