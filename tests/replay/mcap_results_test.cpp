// SPDX-License-Identifier: Apache-2.0
// Output of --mcap, read by the bag reader and record by record.
#include <fstream>
#include <map>

#include <gtest/gtest.h>

#include "bag_writer.hpp"
#include "bags/bag.hpp"
#include "bags/mcap_record.hpp"
#include "bags/messages.hpp"
#include "bags/ros_definitions.hpp"
#include "dds/fast_dds_types.hpp"
#include "drivers/files/capture.hpp"
#include "drivers/files/pcap_writer.hpp"
#include "mcap_text.hpp"
#include "replay_run.hpp"
#include "support/errors.hpp"
#include "support/test_drives.hpp"

namespace locus::test {
namespace {

using tools::McapOp;
using tools::McapRecord;
/// Deserialises by another implementation of CDR.
template <class Message> Message read_by_fast_cdr(std::span<const std::byte> data) {
  std::string bytes(reinterpret_cast<const char*>(data.data()), data.size());
  eprosima::fastcdr::FastBuffer buffer(bytes.data(), bytes.size());
  eprosima::fastcdr::Cdr cdr(buffer, eprosima::fastcdr::Cdr::DEFAULT_ENDIAN, eprosima::fastcdr::Cdr::DDS_CDR);
  cdr.read_encapsulation();
  FastStream<true> stream(cdr);
  Message message;
  stream(message);
  EXPECT_EQ(cdr.getSerializedDataLength(), bytes.size());
  return message;
}

class McapResults : public testing::Test {
 protected:
  McapResults() : replay_({"--mcap", file_, room_drive()}), bytes_(read_text(file_)) {
    EXPECT_EQ(replay_.run().status, 0) << replay_.run().err;
  }

  [[nodiscard]] std::span<const std::byte> bytes(std::uint64_t begin, std::uint64_t size) const {
    return std::as_bytes(std::span{bytes_}).subspan(begin, size);
  }
  [[nodiscard]] McapRecord record_at(std::uint64_t begin) const {
    std::span<const std::byte> rest = bytes(begin, bytes_.size() - begin);
    return tools::pop_mcap_record(rest).value();
  }

  TemporaryFolder folder_;
  std::string file_ = folder_ / "out.mcap";
  Replay replay_;
  std::string bytes_;
};

TEST_F(McapResults, ContainsTheOdometryOfEverySweep) {
  const auto bag = tools::open_bag(file_);
  ASSERT_TRUE(bag) << bag.error();
  const std::vector<StampedPose> trajectory = replay_.trajectory();
  std::map<std::string, std::size_t> count;
  while (const tools::BagMessage* message = (*bag)->next()) {
    const tools::BagTopic& topic = (*bag)->topics().at(message->topic);
    const std::size_t k = count[topic.name + " " + topic.type]++;
    if (topic.name != "/locus/odometry")
      continue;
    const auto odometry = tools::read_odometry({message->data, topic.serialisation});
    ASSERT_TRUE(odometry);
    ASSERT_LT(k, trajectory.size());
    EXPECT_NEAR(to_seconds(message->recorded - trajectory[k].stamp), 0, 1e-6) << "the file of poses has microseconds";
    EXPECT_NEAR(odometry->pose_.pose_.position_.x_, trajectory[k].T_source_base.translation.x(), 1e-6);
    EXPECT_NEAR(odometry->pose_.pose_.orientation_.z_, trajectory[k].T_source_base.rotation.z(), 1e-6);
    EXPECT_GT(odometry->pose_.covariance_[0], 0);
  }
  EXPECT_TRUE((*bag)->warnings().empty());
  EXPECT_GT(trajectory.size(), 70U);
  EXPECT_EQ(count["/locus/odometry nav_msgs/Odometry"], trajectory.size());
  EXPECT_EQ(count["/tf tf2_msgs/TFMessage"], trajectory.size());
  EXPECT_EQ(count["/locus/cloud sensor_msgs/PointCloud2"], trajectory.size());
  const double duration_s = to_seconds(trajectory.back().stamp - trajectory.front().stamp);
  EXPECT_NEAR(static_cast<double>(count["/diagnostics diagnostic_msgs/DiagnosticArray"]), duration_s, 2);
  EXPECT_EQ(count["/tf_static tf2_msgs/TFMessage"], 2U) << "of the lidar and the IMU";
  EXPECT_NEAR(static_cast<double>(count["/front/packets nebula_msgs/NebulaPackets"]), 10 * duration_s, 10);
  EXPECT_GT(count["/imu/data sensor_msgs/Imu"], 7U * 90);
  EXPECT_GT(count["/wheel_odometry nav_msgs/Odometry"], 7U * 40);
  EXPECT_EQ(count.size(), 8U);
}

/// The inputs in the file are those of the recording, to the last bit that a message can hold.
TEST_F(McapResults, ContainsTheSamplesOfTheMotionSources) {
  const auto bag = tools::open_bag(file_);
  ASSERT_TRUE(bag) << bag.error();
  auto recorded = MotionSamples<ImuSample>::open(room_drive() / "imu.csv");
  ASSERT_TRUE(recorded) << recorded.error();
  std::map<Stamp, ImuSample> by_stamp;
  for (const ImuSample& sample : recorded->drain())
    by_stamp[sample.stamp] = sample;
  std::size_t compared = 0;
  while (const tools::BagMessage* message = (*bag)->next()) {
    const tools::BagTopic& topic = (*bag)->topics().at(message->topic);
    if (topic.type != "sensor_msgs/Imu")
      continue;
    const auto imu = read_by_fast_cdr<FastImu>(message->data);
    const Stamp stamp{std::chrono::seconds{imu.header.sec} + std::chrono::nanoseconds{imu.header.nanosec}};
    ASSERT_TRUE(by_stamp.contains(stamp));
    EXPECT_EQ(message->recorded, by_stamp[stamp].arrival);
    EXPECT_EQ(imu.header.frame_id, "imu");
    EXPECT_EQ(imu.angular_velocity[2], by_stamp[stamp].angular_velocity_radps.z());
    EXPECT_EQ(imu.linear_acceleration[0], by_stamp[stamp].specific_force_mps2.x());
    ++compared;
  }
  EXPECT_GT(compared, 7U * 90);
}

/// The inputs suffice, and the outputs beside them are not used.
TEST_F(McapResults, ReplaysToTheSameBits) {
  const Replay again({file_});
  EXPECT_EQ(again.run().err, "");
  EXPECT_TRUE(contains(again.run().out, "/front/packets is lidar front, /wheel_odometry is wio, /imu/data is imu; not "
                                        "used: /locus/odometry, /locus/cloud"))
      << again.run().out;
  EXPECT_TRUE(read_text(again.file("odometry.csv")) == read_text(replay_.file("odometry.csv")));
  EXPECT_EQ(again.summary()["packets"], replay_.summary()["packets"]);
}

/// A drive without odometry: that of the service beside it is no input.
TEST(McapInputs, ReplayWithoutTheOdometryOfTheService) {
  const TemporaryFolder folder;
  const std::string file = folder / "out.mcap", imu = "motion_sources=[{name: imu, kind: imu, topic: /imu/data}]";
  const Replay first({"--set", imu, "--mcap", file, room_drive()});
  const Replay by_default({file}), again({"--set", imu, file});
  EXPECT_FALSE(contains(by_default.run().out, "/locus/odometry is")) << by_default.run().out;
  EXPECT_TRUE(read_text(again.file("odometry.tum")) == read_text(first.file("odometry.tum")));
}

/// A corrected cloud would be corrected a second time.
TEST(McapInputs, CloudsOfTheServiceAreNoInput) {
  const TemporaryFolder folder;
  std::vector<RecordedMessage> messages;
  for (const CloudTurn& turn : turns_of(room_drive() / "lidar.pcap")) {
    const OwnCloud cloud = cloud_of(turn, CloudKind::velodyne);
    messages.push_back({"/locus/cloud", type_of(cloud), turn.end(), cloud_message(cloud, RosVersion::ros2)});
  }
  std::ofstream{folder / "results.mcap", std::ios::binary} << mcap_file(messages, RosVersion::ros2);
  const Replay refused({folder / "results.mcap"});
  EXPECT_EQ(refused.run().status, 1);
  EXPECT_TRUE(contains(refused.run().err, "but /locus/cloud (sensor_msgs/PointCloud2); record the lidar's packets"))
      << refused.run().err;
  const Replay named({"--duration", "1", "--set", "lidars.0.topic=/locus/cloud", folder / "results.mcap"});
  EXPECT_EQ(named.run().status, 0) << named.run().err;
}

/// Another computer sends to the port of the lidar, from the first second on.
TEST(McapInputs, LeaveOutThePacketsOfOtherSenders) {
  const TemporaryFolder folder;
  auto capture = Capture::open(room_drive() / "lidar.pcap");
  ASSERT_TRUE(capture) << capture.error();
  auto both = PcapWriter::open(folder / "both.pcap");
  ASSERT_TRUE(both) << both.error();
  for (std::uint64_t count = 0; const Datagram* datagram = capture->next(); ++count) {
    both->write(*datagram);
    Datagram foreign = *datagram;
    foreign.source_ip += 1;
    if (count > 750)
      both->write(foreign);
  }
  ASSERT_EQ(both->flush(), std::nullopt);
  const Replay first({"--set", "motion_sources=[]", "--mcap", folder / "out.mcap", folder / "both.pcap"});
  const Replay again({"--set", "motion_sources=[]", folder / "out.mcap"});
  EXPECT_GT(first.summary()["packets"]["front"]["rejected"]["sender"], 100);
  EXPECT_EQ(again.summary()["packets"]["front"]["rejected"]["sender"], 0);
  EXPECT_TRUE(read_text(again.file("odometry.tum")) == read_text(first.file("odometry.tum")));
}

TEST_F(McapResults, IsReadableByAnotherCdrLibrary) {
  const auto bag = tools::open_bag(file_);
  ASSERT_TRUE(bag) << bag.error();
  std::size_t points = 0, statuses = 0, transforms = 0;
  while (const tools::BagMessage* message = (*bag)->next()) {
    const auto& [name, type, unused] = (*bag)->topics().at(message->topic);
    if (name == "/tf") {
      const auto tf = read_by_fast_cdr<FastTransforms>(message->data);
      ASSERT_EQ(tf.transforms.size(), 1U);
      EXPECT_EQ(tf.transforms[0].header.frame_id, "odom");
      EXPECT_EQ(tf.transforms[0].child_frame_id, "base_link");
      ++transforms;
    } else if (type == "sensor_msgs/PointCloud2") {
      const auto cloud = read_by_fast_cdr<FastCloud>(message->data);
      EXPECT_EQ(cloud.header.frame_id, "base_link");
      EXPECT_EQ(cloud.data.size(), std::size_t{cloud.width} * cloud.point_step);
      points += cloud.width;
    } else if (type == "diagnostic_msgs/DiagnosticArray") {
      const auto diagnostics = read_by_fast_cdr<FastDiagnostics>(message->data);
      ASSERT_GE(diagnostics.statuses.size(), 4U) << "odometry, lidar, imu, wheels";
      EXPECT_EQ(diagnostics.statuses[0].name, "locusd");
      EXPECT_EQ(diagnostics.statuses[1].name, "locusd: lidar front");
      EXPECT_EQ(diagnostics.statuses[1].message, "receiving");
      ++statuses;
    }
  }
  EXPECT_GT(points, 10'000U);
  EXPECT_GT(statuses, 5U);
  EXPECT_GT(transforms, 70U);
}

/// The index locates each message, as players require, and the checksums are correct.
TEST_F(McapResults, IndexLocatesEachMessage) {
  constexpr std::size_t kEnd = tools::kMcapFooterBytes + tools::kMcapMagic.size();
  const auto footer = tools::McapFooter::read(record_at(bytes_.size() - kEnd));
  ASSERT_TRUE(footer);
  EXPECT_EQ(footer->summary_crc,
            tools::mcap_crc(bytes(footer->summary_start, bytes_.size() - kEnd + 9 + 16 - footer->summary_start)));
  std::map<McapOp, int> records;
  std::uint64_t indexed = 0, messages = 0;
  std::span<const std::byte> rest = bytes(footer->summary_start, footer->summary_offset_start - footer->summary_start);
  while (const auto record = tools::pop_mcap_record(rest)) {
    ++records[record->op];
    MessageReader fields = record->fields();
    if (record->op == McapOp::statistics)
      messages = fields.number<std::uint64_t>();
    if (record->op != McapOp::chunk_index)
      continue;
    const auto first_ns = fields.number<std::uint64_t>(), last_ns = fields.number<std::uint64_t>();
    const auto begin = fields.number<std::uint64_t>(), length = fields.number<std::uint64_t>();
    MessageReader indices(fields.sequence(), Serialisation::ros1);
    const auto indices_length = fields.number<std::uint64_t>();
    const McapRecord chunk = record_at(begin);
    ASSERT_EQ(chunk.op, McapOp::chunk);
    EXPECT_EQ(tools::kMcapRecordHead + chunk.content.size(), length);
    std::vector<std::byte> room;
    const tools::McapChunkRecords unpacked = tools::unpack_mcap_chunk(chunk, room);
    EXPECT_EQ(unpacked.problem, "");
    std::uint64_t indices_seen = 0;
    for (auto channel = indices.number<std::uint16_t>(); indices.whole(); channel = indices.number<std::uint16_t>()) {
      const McapRecord index = record_at(indices.number<std::uint64_t>());
      ASSERT_EQ(index.op, McapOp::message_index);
      indices_seen += tools::kMcapRecordHead + index.content.size();
      MessageReader entries = index.fields();
      EXPECT_EQ(entries.number<std::uint16_t>(), channel);
      MessageReader times(entries.sequence(), Serialisation::ros1);
      for (auto ns = times.number<std::uint64_t>(); times.whole(); ns = times.number<std::uint64_t>()) {
        EXPECT_TRUE(ns >= first_ns && ns <= last_ns);
        std::span<const std::byte> at = unpacked.bytes.subspan(times.number<std::uint64_t>());
        const McapRecord message = tools::pop_mcap_record(at).value();
        MessageReader of_message = message.fields();
        EXPECT_EQ(message.op, McapOp::message);
        EXPECT_EQ(of_message.number<std::uint16_t>(), channel);
        of_message.number<std::uint32_t>(); // sequence number
        EXPECT_EQ(of_message.number<std::uint64_t>(), ns);
        ++indexed;
      }
    }
    EXPECT_EQ(indices_seen, indices_length);
  }
  EXPECT_TRUE(rest.empty());
  EXPECT_EQ(records[McapOp::schema], 8);
  EXPECT_EQ(records[McapOp::channel], 8);
  EXPECT_EQ(records[McapOp::statistics], 1);
  EXPECT_GT(records[McapOp::chunk_index], 3);
  EXPECT_EQ(indexed, messages);
  EXPECT_GT(messages, 200U);
}

TEST(McapDefinitions, ContainEachNestedTypeOnce) {
  const std::string text = tools::ros2_definition("nav_msgs/msg/Odometry");
  EXPECT_TRUE(text.starts_with("std_msgs/Header header\nstring child_frame_id\n")) << text;
  for (const char* const name :
       {"builtin_interfaces/Time", "std_msgs/Header", "geometry_msgs/Point", "geometry_msgs/Quaternion",
        "geometry_msgs/Vector3", "geometry_msgs/Pose", "geometry_msgs/PoseWithCovariance", "geometry_msgs/Twist",
        "geometry_msgs/TwistWithCovariance"}) {
    const std::string head = std::string(80, '=') + "\nMSG: " + name + "\n";
    const std::size_t found = text.find(head);
    ASSERT_NE(found, std::string::npos) << name;
    EXPECT_EQ(text.find(head, found + 1), std::string::npos) << name;
  }
  EXPECT_EQ(text.find("PointField"), std::string::npos);
}

TEST(McapOption, OverwritesNoInputAndReportsUnwritableFiles) {
  const TemporaryFolder folder;
  const std::string capture = folder / "drive.pcap";
  std::filesystem::copy_file(room_drive() / "lidar.pcap", capture);
  const auto refusal = [&](const std::string& file, int status) {
    const ProgramRun run = run_program(LOCUS_REPLAY, {"-o", folder / "out", "--mcap", file, capture});
    EXPECT_EQ(run.status, status);
    EXPECT_EQ(lines_of(run.err).size(), 1U) << run.err;
    return run.err;
  };
  EXPECT_TRUE(contains(refusal(capture, 2), "choose another file with --mcap"));
  EXPECT_EQ(std::filesystem::file_size(capture), std::filesystem::file_size(room_drive() / "lidar.pcap"));
  EXPECT_TRUE(contains(refusal("/nowhere/out.mcap", 1), "/nowhere/out.mcap: cannot be written"));
  EXPECT_TRUE(contains(refusal("/dev/full", 1), "/dev/full: cannot be written"));
  EXPECT_LT(lines_of(read_text(folder / "out/odometry.csv")).size(), 70U) << "reported before the end of the run";
  EXPECT_EQ(
      run_program(LOCUS_REPLAY, {"-o", folder / "out", "--realtime", "--mcap", folder / "a.mcap", capture}).status, 2);
}

/// Runs locus-replay, which must reject the arguments before it writes anything; returns the error.
std::string refusal_of(const std::vector<std::string>& arguments) {
  const ProgramRun run = run_program(LOCUS_REPLAY, arguments);
  EXPECT_EQ(run.status, 2) << run.err;
  EXPECT_EQ(lines_of(run.err).size(), 1U) << run.err;
  return run.err;
}

TEST(McapOption, LeavesTheFolderOfABagUnchanged) {
  const TemporaryFolder folder;
  std::filesystem::create_directories(folder / "drive");
  const std::string part = folder / "drive/drive_0.mcap", link = folder / "link.mcap";
  const std::string bytes = mcap_file(messages_of(room_drive(), RosVersion::ros2), RosVersion::ros2);
  std::ofstream{part, std::ios::binary} << bytes;
  std::filesystem::create_symlink(part, link);
  for (const std::string& file : {part, (folder / "drive/new.mcap").string()})
    EXPECT_TRUE(contains(refusal_of({"-o", folder / "out", "--mcap", file, folder / "drive/"}),
                         file == part ? "choose another file with --mcap" : "choose a file in another folder"));
  EXPECT_TRUE(contains(refusal_of({"-o", folder / "out", "--mcap", link, folder / "drive"}), "drive_0.mcap: the run"));
  EXPECT_TRUE(read_text(part) == bytes);
  EXPECT_FALSE(std::filesystem::exists(folder / "drive/new.mcap"));
  EXPECT_FALSE(std::filesystem::exists(folder / "out"));
}

TEST(McapOption, LeavesEveryFileOfACaptureFolderUnchanged) {
  const TemporaryFolder folder;
  const std::filesystem::path drive = folder / "drive";
  std::filesystem::copy(room_drive(), drive);
  for (const auto& file : std::filesystem::directory_iterator(drive)) {
    const std::string bytes = read_text(file.path());
    const std::string link = folder / "link";
    std::filesystem::create_hard_link(file.path(), link);
    for (const std::string& name : {link, file.path().string()})
      EXPECT_TRUE(contains(refusal_of({"-o", folder / "out", "--mcap", name, drive}), "the run would write its own"));
    EXPECT_TRUE(read_text(file.path()) == bytes) << file.path();
    std::filesystem::remove(link);
  }
  EXPECT_TRUE(contains(refusal_of({"-o", folder / "out", "--mcap", drive / "new.mcap", drive}), "lies in"));
}

TEST(McapOption, OverwritesNoOtherResultOfTheRun) {
  const TemporaryFolder folder;
  for (const char* const name : {"odometry.csv", "summary.json", "../out/map.pcd"})
    EXPECT_TRUE(contains(refusal_of({"-o", folder / "out", "--mcap", folder / "out" / name, room_drive()}),
                         "the run writes its "))
        << name;
  EXPECT_FALSE(std::filesystem::exists(folder / "out"));
}

} // namespace
} // namespace locus::test
