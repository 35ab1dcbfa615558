// SPDX-License-Identifier: Apache-2.0
// Bags of ouster-ros with the packets of a sensor, and its metadata on a topic or in a file.
#include <algorithm>
#include <fstream>
#include <iterator>
#include <utility>

#include <gtest/gtest.h>

#include "bag_writer.hpp"
#include "drivers/files/capture.hpp"
#include "mcap_text.hpp"
#include "replay_run.hpp"
#include "support/errors.hpp"

namespace locus::test {
namespace {

/// Serialises a message of one string or byte sequence.
std::vector<std::byte> message_of(std::string text, RosVersion ros, bool is_string) {
  if (is_string && ros == RosVersion::ros2)
    text += '\0'; // CDR counts the terminating zero
  const auto size = static_cast<std::uint32_t>(text.size());
  const std::string encapsulation = ros == RosVersion::ros2 ? std::string("\0\1\0\0", 4) : "";
  const std::string all = encapsulation + std::string(reinterpret_cast<const char*>(&size), sizeof(size)) + text;
  const auto* begin = reinterpret_cast<const std::byte*>(all.data());
  return {begin, begin + all.size()};
}

/// A short drive of a simulated OS1-32 with its IMU, as a capture and in messages.
class OusterBags : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    drive_ = new TemporaryFolder;
    const ProgramRun run = run_program(LOCUS_SIM, {"--world", "urban", "--robot", "husky", "--model", "OS1-32",
                                                   "--duration", "3", "-o", drive() / "sim"});
    ASSERT_EQ(run.status, 0) << run.err;
    std::filesystem::create_directories(drive() / "capture");
    std::filesystem::copy(drive() / "sim/lidar.pcap", drive() / "capture/drive.pcap");
    std::filesystem::copy(drive() / "sim/top.json", drive() / "capture/drive.json");
  }
  static void TearDownTestSuite() { delete std::exchange(drive_, nullptr); }

  static std::filesystem::path drive() { return drive_->path(); }
  static std::string metadata() { return read_text(drive() / "capture/drive.json"); }

  /// Returns the packets as ouster-ros records them. `extra`: bytes that older releases append.
  static std::vector<RecordedMessage> packets(RosVersion ros, const std::string& package, std::size_t extra = 0) {
    std::vector<RecordedMessage> messages;
    Expected<Capture, std::string> capture = Capture::open(drive() / "capture/drive.pcap");
    EXPECT_TRUE(capture) << capture.error();
    while (const Datagram* datagram = capture->next()) {
      const std::string payload(reinterpret_cast<const char*>(datagram->payload.data()), datagram->payload.size());
      const bool is_imu = datagram->destination_port == 7503;
      messages.push_back({is_imu ? "/ouster/imu_packets" : "/ouster/lidar_packets", package + "/PacketMsg",
                          datagram->receive_stamp, message_of(payload + std::string(extra, '\0'), ros, false)});
    }
    return messages;
  }
  static RecordedMessage metadata_message(RosVersion ros, Stamp recorded) {
    return {"/ouster/metadata", "std_msgs/String", recorded, message_of(metadata(), ros, true)};
  }
  static std::vector<RecordedMessage> with_metadata(RosVersion ros, std::vector<RecordedMessage> messages) {
    messages.insert(messages.begin(), metadata_message(ros, messages.front().recorded));
    return messages;
  }
  static std::string odometry(const Replay& replay) {
    EXPECT_EQ(replay.run().status, 0) << replay.run().err;
    return read_text(replay.file("odometry.csv"));
  }
  static std::string odometry_of_capture() {
    static const std::string text = odometry(Replay({drive() / "capture/drive.pcap"}));
    return text;
  }
  void write(const std::string& name, const std::string& bytes) const {
    std::ofstream{folder_ / name, std::ios::binary} << bytes;
  }

  TemporaryFolder folder_;

 private:
  static TemporaryFolder* drive_;
};
TemporaryFolder* OusterBags::drive_ = nullptr;

TEST_F(OusterBags, PacketsAndMetadataOfABagGiveTheBitsOfTheCapture) {
  write("ros2.mcap",
        mcap_file(with_metadata(RosVersion::ros2, packets(RosVersion::ros2, "ouster_sensor_msgs")), RosVersion::ros2));
  write("ros1.bag", ros1_bag(with_metadata(RosVersion::ros1, packets(RosVersion::ros1, "ouster_ros", 1))));
  write_db3(folder_ / "foxy.db3", with_metadata(RosVersion::ros2, packets(RosVersion::ros2, "ouster_msgs")));
  for (const char* const name : {"ros2.mcap", "ros1.bag", "foxy.db3"}) {
    const Replay replay({folder_ / name});
    EXPECT_TRUE(odometry(replay) == odometry_of_capture()) << name;
    EXPECT_EQ(replay.run().err, "") << name;
    EXPECT_TRUE(contains(replay.run().out, std::string{name} + ": /ouster/metadata: the metadata of lidar front"))
        << replay.run().out;
    EXPECT_TRUE(contains(replay.run().out, "/ouster/lidar_packets is lidar front, /ouster/imu_packets is front_imu"))
        << replay.run().out;
  }
}

TEST_F(OusterBags, DiscoveredConfigurationGivesTheSameBits) {
  write("drive.bag", ros1_bag(with_metadata(RosVersion::ros1, packets(RosVersion::ros1, "ouster_ros"))));
  for (const std::string recording : {folder_ / "drive.bag", drive() / "capture/drive.pcap"}) {
    const ProgramRun found = run_program(LOCUS_REPLAY, {"--discover", recording});
    EXPECT_EQ(found.status, 0) << found.err;
    write("found.yaml", found.out);
    const Replay replay({"-c", folder_ / "found.yaml", recording});
    EXPECT_TRUE(odometry(replay).size() > 1000 &&
                read_text(replay.file("odometry.tum")) ==
                    read_text(Replay({drive() / "capture/drive.pcap"}).file("odometry.tum")))
        << found.out;
    EXPECT_EQ(replay.run().err, "");
    EXPECT_TRUE(contains(found.out, "OS1-32 with serial number") || contains(found.out, "/ouster/metadata"))
        << found.out;
  }
}

TEST_F(OusterBags, WrittenInputsReplayToTheSameBits) {
  const Replay first({"--mcap", folder_ / "out.mcap", drive() / "capture/drive.pcap"});
  EXPECT_TRUE(odometry(first) == odometry_of_capture());
  const Replay again({folder_ / "out.mcap"});
  EXPECT_TRUE(odometry(again) == odometry_of_capture());
  EXPECT_EQ(again.run().err, "");
  EXPECT_TRUE(contains(again.run().out, "/front/lidar_packets is lidar front, /front/imu_packets is front_imu"))
      << again.run().out;
}

TEST_F(OusterBags, MetadataMayComeAfterTheFirstPacketsOrLieBesideTheBag) {
  std::vector<RecordedMessage> late = packets(RosVersion::ros2, "ouster_sensor_msgs");
  const RecordedMessage inserted = metadata_message(RosVersion::ros2, late[100].recorded);
  late.insert(late.begin() + 100, inserted);
  write("late.mcap", mcap_file(late, RosVersion::ros2));
  EXPECT_TRUE(odometry(Replay({folder_ / "late.mcap"})) == odometry_of_capture());

  write("alone.mcap", mcap_file(packets(RosVersion::ros2, "ouster_sensor_msgs"), RosVersion::ros2));
  const Replay refused({folder_ / "alone.mcap"});
  EXPECT_EQ(refused.run().status, 2);
  EXPECT_TRUE(contains(refused.run().err, "/ouster/lidar_packets is of an Ouster, whose packets cannot be read without "
                                          "its metadata"))
      << refused.run().err;
  write("alone.json", metadata());
  EXPECT_TRUE(odometry(Replay({folder_ / "alone.mcap"})) == odometry_of_capture());
  std::filesystem::create_directories(folder_ / "bag");
  std::filesystem::rename(folder_ / "alone.mcap", folder_ / "bag/bag_0.mcap");
  std::filesystem::rename(folder_ / "alone.json", folder_ / "bag/os1.json");
  EXPECT_TRUE(odometry(Replay({folder_ / "bag"})) == odometry_of_capture()) << "in the folder of the bag";
}

TEST_F(OusterBags, CloudsAreUsedIfTheMetadataAreMissing) {
  CloudTurn turn{stamp_from_ns(1'700'000'000'000'000'000), {}};
  for (int i = 0; i < 2000; ++i)
    turn.points.push_back({{3.0F + 1e-3F * static_cast<float>(i), 1, 0}, 0, 1, turn.begin + Duration{40'000 * i}});
  const std::vector<RecordedMessage> sent = packets(RosVersion::ros2, "ouster_sensor_msgs");
  std::vector<RecordedMessage> messages(sent.begin(), sent.begin() + 100);
  const OwnCloud cloud = cloud_of(turn, CloudKind::velodyne_start);
  messages.push_back({"/ouster/points", type_of(cloud), turn.end() + std::chrono::milliseconds{4},
                      cloud_message(cloud, RosVersion::ros2)});
  write("both.mcap", mcap_file(messages, RosVersion::ros2));
  const Replay replay({folder_ / "both.mcap"});
  EXPECT_TRUE(contains(replay.run().out, "no metadata for the packets of its Ouster, so the clouds on /ouster/points"))
      << replay.run().out;
  EXPECT_TRUE(contains(replay.run().out, "/ouster/points is lidar front")) << replay.run().out;
}

TEST_F(OusterBags, ConfigurationMayNameTheMetadata) {
  write("drive.mcap", mcap_file(packets(RosVersion::ros2, "ouster_sensor_msgs"), RosVersion::ros2));
  const Replay replay({"--set", "lidars.0.metadata=" + (drive() / "capture/drive.json").string(), "--set",
                       "lidars.0.port=7502", folder_ / "drive.mcap"});
  EXPECT_TRUE(odometry(replay) == odometry_of_capture());
}

} // namespace
} // namespace locus::test
