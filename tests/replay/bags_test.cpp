// SPDX-License-Identifier: Apache-2.0
// Replay of bags of ROS 1 and ROS 2.
#include <algorithm>
#include <array>
#include <cstring>
#include <fstream>
#include <limits>
#include <numeric>

#include <gtest/gtest.h>
#include <sqlite3.h>

#include "bag_writer.hpp"
#include "bags/bag.hpp"
#include "bags/messages.hpp"
#include "bags/ros1_record.hpp"
#include "daemon/dds/ros_messages.hpp"
#include "mcap_text.hpp"
#include "replay_run.hpp"
#include "support/errors.hpp"
#include "support/test_drives.hpp"

namespace locus::test {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;
using namespace std::string_literals;

template <RosVersion ros> const std::vector<RecordedMessage>& room_messages() {
  static const std::vector<RecordedMessage> messages = messages_of(room_drive(), ros);
  return messages;
}

const std::vector<RecordedMessage>& room_messages(RosVersion ros) {
  return ros == RosVersion::ros1 ? room_messages<RosVersion::ros1>() : room_messages<RosVersion::ros2>();
}

void write_text(const std::filesystem::path& file, const std::string& text) {
  std::ofstream{file, std::ios::binary} << text;
}

/// Replays the room drive. Packets are timed by reception, because position packets are in a capture but not in a bag.
Replay replay_room(const std::string& capture, std::vector<std::string> arguments = {}) {
  arguments.insert(arguments.end(), {"-c", room_drive() / "config.yaml", "--set", "lidars.0.time=receive", capture});
  return Replay(arguments);
}

/// Equal up to rounding: quaternions are normalised once more in the conversion.
void expect_same_odometry(const Replay& replay) {
  static const std::vector<StampedPose> of_capture = replay_room(room_drive()).trajectory();
  ASSERT_EQ(replay.run().status, 0) << replay.run().err;
  const std::vector<StampedPose> trajectory = replay.trajectory();
  ASSERT_EQ(trajectory.size(), of_capture.size());
  for (std::size_t i = 0; i < trajectory.size(); ++i) {
    EXPECT_EQ(trajectory[i].stamp, of_capture[i].stamp);
    const Pose &pose = trajectory[i].T_source_base, &expected = of_capture[i].T_source_base;
    EXPECT_LT((pose.translation - expected.translation).norm(), 1e-9);
    EXPECT_LT(pose.rotation.angularDistance(expected.rotation), 1e-7) << "acos near 1";
  }
}

void expect_line(const std::string& text, const std::vector<std::string>& parts) {
  for (const std::string& part : parts)
    EXPECT_NE(text.find(part), std::string::npos) << "no '" << part << "' in: " << text;
}

TEST(Bags, Ros1BagGivesTheOdometryOfTheCapture) {
  const TemporaryFolder folder;
  write_text(folder / "drive.bag", ros1_bag(room_messages(RosVersion::ros1)));
  const Replay replay = replay_room(folder / "drive.bag");
  expect_same_odometry(replay);
  expect_line(replay.run().out,
              {"/2368/velodyne_packets is lidar front", "/imu/data is imu", "/wheel_odometry is wio"});
}

TEST(Bags, PacketsAloneGiveTheSameBits) {
  const TemporaryFolder folder;
  std::vector<RecordedMessage> scans = room_messages(RosVersion::ros1);
  std::erase_if(scans, [](const RecordedMessage& message) { return !message.topic.ends_with("packets"); });
  write_text(folder / "drive.bag", ros1_bag(scans));
  const Replay bag({folder / "drive.bag"});
  const Replay capture({"--set", "lidars.0.time=receive", room_drive() / "lidar.pcap"});
  EXPECT_EQ(bag.run().err, "");
  EXPECT_EQ(read_text(bag.file("odometry.csv")), read_text(capture.file("odometry.csv")));
  EXPECT_EQ(read_text(bag.file("odometry.tum")), read_text(capture.file("odometry.tum")));
}

TEST(Bags, Ros2BagGivesTheOdometryOfTheCapture) {
  const TemporaryFolder folder;
  write_db3(folder / "drive_0.db3", room_messages(RosVersion::ros2));
  expect_same_odometry(replay_room(folder / "drive_0.db3"));
}

/// Converters and early recorders leave the column empty, because only one serialisation existed.
TEST(Bags, Ros2BagWithoutSerialisationIsCdr) {
  const TemporaryFolder folder;
  write_db3(folder / "drive_0.db3", room_messages(RosVersion::ros2), "");
  expect_same_odometry(replay_room(folder / "drive_0.db3"));
}

TEST(Bags, Ros2FolderIsReadInTheOrderOfItsMetadata) {
  const TemporaryFolder folder;
  const std::span<const RecordedMessage> messages = room_messages(RosVersion::ros2);
  write_db3(folder / "b.db3", messages.first(messages.size() / 3));
  write_db3(folder / "a.db3", messages.subspan(messages.size() / 3));
  write_text(folder / "metadata.yaml", "rosbag2_bagfile_information:\n  storage_identifier: sqlite3\n"
                                       "  relative_file_paths:\n    - drive/b.db3\n    - a.db3\n"
                                       "  compression_format: \"\"\n  compression_mode: \"\"\n");
  expect_same_odometry(replay_room(folder.path()));
  write_text(folder / "metadata.yaml", "rosbag2_bagfile_information:\n  storage_identifier: \"\"\n"
                                       "  relative_file_paths: [b.db3, a.db3]\n");
  expect_same_odometry(replay_room(folder.path()));
}

TEST(Bags, BagOfTwoLidarsGivesTheirPacketsInTheOrderOfReception) {
  const TemporaryFolder folder;
  write_room_drive(folder / "capture", seconds{3}, 2);
  std::vector<RecordedMessage> messages = messages_of(folder / "capture", RosVersion::ros1);
  for (RecordedMessage& message : messages) {
    if (message.topic.starts_with("/236"))
      message.topic = message.topic.starts_with("/2368") ? "/front/velodyne_packets" : "/rear/velodyne_packets";
  }
  write_text(folder / "drive.bag", ros1_bag(messages));
  const std::vector<std::string> options{"-c",    folder / "capture/config.yaml", "--set", "lidars.front.time=receive",
                                         "--set", "lidars.rear.time=receive"};
  const auto odometry = [&](const std::string& capture) {
    std::vector<std::string> arguments = options;
    arguments.push_back(capture);
    const Replay replay(arguments);
    EXPECT_EQ(replay.run().err, "");
    EXPECT_EQ(replay.summary()["packets"]["rear"]["lost"], 0);
    return replay.trajectory();
  };
  const std::vector<StampedPose> of_bag = odometry(folder / "drive.bag"), of_capture = odometry(folder / "capture");
  ASSERT_EQ(of_bag.size(), of_capture.size());
  for (std::size_t i = 0; i < of_bag.size(); ++i)
    EXPECT_LT((of_bag[i].T_source_base.translation - of_capture[i].T_source_base.translation).norm(), 1e-9) << i;
}

/// Order of scripts that merge or convert bags. Playback is ordered by the time of reception.
TEST(Bags, DatabaseWrittenTopicByTopicGivesTheOdometryOfTheCapture) {
  const TemporaryFolder folder;
  std::vector<RecordedMessage> messages = room_messages(RosVersion::ros2);
  std::ranges::stable_sort(messages, {}, &RecordedMessage::topic);
  write_db3(folder / "drive.db3", messages);
  const Replay replay = replay_room(folder / "drive.db3");
  expect_same_odometry(replay);
  EXPECT_EQ(replay.run().err, "");
}

TEST(Bags, UnorderedRos1BagIsReported) {
  const TemporaryFolder folder;
  std::vector<RecordedMessage> messages = room_messages(RosVersion::ros1);
  std::rotate(messages.begin(), messages.begin() + static_cast<std::ptrdiff_t>(messages.size() / 2), messages.end());
  write_text(folder / "drive.bag", ros1_bag(messages));
  expect_line(replay_room(folder / "drive.bag").run().err,
              {"messages follow one that was received later", "rosbag filter"});
}

/// Some versions of rosbag2 leave the database in WAL mode, for which SQLite would create a log on reading.
TEST(Bags, NothingIsWrittenBesideADatabase) {
  const TemporaryFolder folder;
  const std::filesystem::path bag = folder / "bag 100% #1?", file = bag / "drive_0.db3";
  std::filesystem::create_directories(bag);
  write_db3(file, room_messages(RosVersion::ros2));
  {
    std::fstream header{file, std::ios::in | std::ios::out | std::ios::binary};
    header.seekp(18).write("\2\2", 2); // journal mode WAL
  }
  std::filesystem::permissions(bag, std::filesystem::perms{0555});
  expect_same_odometry(replay_room(file));
  std::filesystem::permissions(bag, std::filesystem::perms{0755});
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator{bag}, {}), 1);
}

TEST(Bags, LidarWhoseNameIsPartOfAnothersHasItsOwnTopic) {
  const TemporaryFolder folder;
  write_room_drive(folder / "capture", seconds{2}, 2);
  std::vector<RecordedMessage> messages = messages_of(folder / "capture", RosVersion::ros1);
  for (const auto& [first, second] : {std::pair{"/left/velodyne_packets", "/left_rear/velodyne_packets"},
                                      std::pair{"/scan_left", "/scan_left_rear"}}) {
    std::vector<RecordedMessage> renamed = messages;
    for (RecordedMessage& message : renamed) {
      if (message.topic.starts_with("/236"))
        message.topic = message.topic.starts_with("/2368") ? second : first;
    }
    write_text(folder / "drive.bag", ros1_bag(renamed));
    const Replay replay({"-c", folder / "capture/config.yaml", "--set", "lidars.front.name=left_rear", "--set",
                         "lidars.rear.name=left", folder / "drive.bag"});
    expect_line(replay.run().out, {first + " is lidar left,"s, second + " is lidar left_rear"s});
    const Replay other({"-c", folder / "capture/config.yaml", "--set", "lidars.front.name=lef", "--set",
                        "lidars.rear.name=left_rear", folder / "drive.bag"});
    expect_line(other.run().out, {first + " is lidar lef,"s, second + " is lidar left_rear"s});
  }
}

TEST(Bags, ConfiguredTopicIsNotReplacedByAnother) {
  const TemporaryFolder folder;
  write_text(folder / "drive.bag", ros1_bag(room_messages(RosVersion::ros1)));
  const Replay replay =
      replay_room(folder / "drive.bag", {"--duration", "2", "--set", "motion_sources.wio.topic=/gps/odometry"});
  EXPECT_EQ(replay.run().status, 0);
  expect_line(replay.run().err, {"motion source wio: nothing on /gps/odometry", "/wheel_odometry"});
  expect_line(replay.run().out, {"not used: /wheel_odometry"});
}

TEST(Bags, OnlyTopicOfAKindIsUsedWhateverItsName) {
  const TemporaryFolder folder;
  std::vector<RecordedMessage> messages = room_messages(RosVersion::ros1);
  for (RecordedMessage& message : messages)
    message.topic = message.topic == "/imu/data" ? "/mti/sensor" : message.topic == "/wheel_odometry" ? "/odom" : "/v";
  write_text(folder / "drive.bag", ros1_bag(messages));
  const Replay replay = replay_room(folder / "drive.bag");
  expect_same_odometry(replay);
  expect_line(replay.run().out, {"/v is lidar front", "/mti/sensor is imu", "/odom is wio"});
}

TEST(Bags, TopicIsNotGuessedAmongSeveral) {
  const TemporaryFolder folder;
  std::vector<RecordedMessage> messages = room_messages(RosVersion::ros1);
  for (std::size_t i = 0; i < messages.size(); ++i) {
    if (messages[i].topic == "/wheel_odometry")
      messages[i].topic = i % 2 == 0 ? "/odom_a" : "/odom_b";
  }
  write_text(folder / "drive.bag", ros1_bag(messages));
  const Replay doubtful = replay_room(folder / "drive.bag", {"--duration", "2"});
  EXPECT_EQ(doubtful.run().status, 0);
  expect_line(doubtful.run().err, {"motion source wio", "/odom_a", "/odom_b", "--set motion_sources.wio.topic="});
  const Replay told =
      replay_room(folder / "drive.bag", {"--duration", "2", "--set", "motion_sources.wio.topic=/odom_b"});
  EXPECT_EQ(told.run().err, "");
  expect_line(told.run().out, {"/odom_b is wio", "not used: /odom_a"});
}

TEST(Bags, NamedFileReplacesATopic) {
  const TemporaryFolder folder;
  write_text(folder / "drive.bag", ros1_bag(room_messages(RosVersion::ros1)));
  const Replay replay = replay_room(folder / "drive.bag", {"--imu", room_drive() / "imu.csv"});
  expect_same_odometry(replay);
  expect_line(replay.run().out, {"not used: /imu/data"});
}

/// Bags written by rosbag itself with the messages' own Python code, chunks uncompressed or compressed.
class BagOfRosbag : public testing::TestWithParam<const char*> {};

TEST_P(BagOfRosbag, IsReadFieldByField) {
  const auto bag = tools::open_bag(std::filesystem::path(LOCUS_TEST_BAGS) / GetParam());
  ASSERT_TRUE(bag) << bag.error();
  std::array<std::int64_t, 3> seen{};
  while (const tools::BagMessage* message = (*bag)->next()) {
    const tools::BagTopic& topic = (*bag)->topics()[message->topic];
    const MessageReader reader(message->data, Serialisation::ros1);
    const std::int64_t since_start_ns = to_ns(message->recorded) - 1'700'000'000'000'000'000;
    if (topic.type == tools::kImuType) {
      const std::int64_t k = seen[0]++;
      const ImuSample imu = daemon::to_sample(tools::read_imu(reader).value(), message->recorded);
      EXPECT_EQ(topic.name, "/imu/data");
      EXPECT_EQ(since_start_ns, 2000 * k + 500);
      EXPECT_EQ(to_ns(imu.stamp), 1'700'000'000'000'000'001 + 1000 * k);
      EXPECT_EQ(imu.angular_velocity_radps, Eigen::Vector3d(0.1 + static_cast<double>(k), 0.2, 0.3));
      EXPECT_EQ(imu.specific_force_mps2, Eigen::Vector3d(1, 2, 9.81));
      EXPECT_EQ(imu.attitude.has_value(), k < 2) << "the last one has none";
    } else if (topic.type == tools::kOdometryType) {
      const std::int64_t k = seen[1]++;
      const auto odometry = tools::read_odometry(reader).value();
      EXPECT_EQ(since_start_ns, 5000 * k + 700);
      EXPECT_EQ(odometry.pose_.pose_.position_.x_, 1.5 + static_cast<double>(k));
      EXPECT_EQ(odometry.pose_.pose_.position_.z_, 0.25);
      EXPECT_EQ(odometry.pose_.pose_.orientation_.z_, 1.0);
      EXPECT_EQ(odometry.twist_.covariance_[0], 0.5);
    } else if (const tools::PacketType* type = tools::packet_type(topic.type)) {
      const std::int64_t k = seen[2]++;
      const auto scan = type->read(reader).value();
      ASSERT_EQ(scan.packets.size(), 2U);
      EXPECT_EQ(to_ns(scan.packets[1].stamp), 1'700'000'000'001'327'000 + 100'000'000 * k);
      EXPECT_EQ(scan.payload(scan.packets[1]).back(), std::byte{2});
    }
  }
  EXPECT_EQ(seen, (std::array<std::int64_t, 3>{3, 3, 3}));
  EXPECT_TRUE((*bag)->warnings().empty());
}
INSTANTIATE_TEST_SUITE_P(Compression, BagOfRosbag, testing::Values("none.bag", "lz4.bag", "bz2.bag"));

/// Corrupts each byte of a bag: reading terminates and finds no additional messages.
void expect_damage_is_borne(const std::string& bytes, const std::string& name, int messages) {
  const TemporaryFolder folder;
  for (std::size_t at = 0; at < bytes.size(); at += at < 6000 ? 11 : 37) {
    std::string damaged = bytes;
    damaged[at] = static_cast<char>(~damaged[at]);
    write_text(folder / name, damaged);
    const auto bag = tools::open_bag(folder / name);
    int read = 0;
    while (const tools::BagMessage* message = bag ? (*bag)->next() : nullptr) {
      ++read;
      const MessageReader reader(message->data, (*bag)->topics()[message->topic].serialisation);
      static_cast<void>(tools::read_imu(reader));
      static_cast<void>(tools::read_odometry(reader));
      for (const tools::PacketType& type : tools::packet_types())
        static_cast<void>(type.read != nullptr && type.read(reader));
    }
    EXPECT_LE(read, messages) << "byte " << at;
  }
}

TEST_P(BagOfRosbag, SurvivesAnyDamage) {
  expect_damage_is_borne(read_text(std::filesystem::path(LOCUS_TEST_BAGS) / GetParam()), "damaged.bag", 9);
}

TEST(Bags, DamagedDatabaseNeverHangsOrCrashes) {
  const TemporaryFolder folder;
  std::vector<RecordedMessage> messages;
  for (int i = 0; i < 60; ++i)
    messages.push_back({"/imu/data", "sensor_msgs/Imu", stamp_from_ns(i), imu_message({}, RosVersion::ros2)});
  write_db3(folder / "whole.db3", messages);
  expect_damage_is_borne(read_text(folder / "whole.db3"), "damaged.db3", 60);
}

/// A killed recorder leaves a bag without index, often with a truncated chunk at its end.
TEST(Bags, BagWithoutIndexIsReadToItsEnd) {
  const TemporaryFolder folder;
  write_text(folder / "drive.bag.active", ros1_bag(room_messages(RosVersion::ros1), BagEnd::without_index));
  const Replay replay = replay_room(folder / "drive.bag.active");
  EXPECT_EQ(replay.run().status, 0);
  expect_line(replay.run().err, {"warning: ", "drive.bag.active", "no index", "rosbag reindex"});
  expect_same_odometry(replay);
}

TEST(Bags, TruncatedBagIsReadUpToTheCut) {
  const TemporaryFolder folder;
  std::string bytes = ros1_bag(room_messages(RosVersion::ros1));
  bytes.resize(bytes.size() / 2);
  write_text(folder / "cut.bag", bytes);
  const Replay replay = replay_room(folder / "cut.bag");
  EXPECT_EQ(replay.run().status, 0);
  ASSERT_EQ(lines_of(replay.run().err).size(), 1U) << replay.run().err;
  expect_line(replay.run().err, {"warning: ", "cut.bag: byte ", "ends in mid-record"});
  EXPECT_NEAR(static_cast<double>(replay.trajectory().size()), 40, 2);
}

TEST(Bags, TruncatedDatabaseIsReadUpToTheCut) {
  const TemporaryFolder folder;
  write_db3(folder / "cut.db3", room_messages(RosVersion::ros2));
  std::filesystem::resize_file(folder / "cut.db3", std::filesystem::file_size(folder / "cut.db3") / 2);
  const Replay replay = replay_room(folder / "cut.db3");
  EXPECT_EQ(replay.run().status, 0);
  ASSERT_EQ(lines_of(replay.run().err).size(), 1U) << replay.run().err;
  expect_line(replay.run().err, {"warning: ", "cut.db3: message ", "is truncated or damaged"});
  EXPECT_NEAR(static_cast<double>(replay.trajectory().size()), 40, 10);
}

class BadBag : public testing::Test {
 protected:
  /// Expects one line on stderr with all these parts.
  void expect_refused(const std::string& name, const std::vector<std::string>& said) {
    const ProgramRun run = run_program(LOCUS_REPLAY, {"-o", folder_ / "out", folder_ / name});
    EXPECT_EQ(run.status, 1) << run.err;
    EXPECT_EQ(lines_of(run.err).size(), 1U) << run.err;
    expect_line(run.err, {name});
    expect_line(run.err, said);
  }
  void expect_refused(const std::string& name, const std::string& content, const std::vector<std::string>& said) {
    write_text(folder_ / name, content);
    expect_refused(name, said);
  }

  TemporaryFolder folder_;
};

TEST_F(BadBag, Empty) {
  expect_refused("a.bag", "", {"empty"});
  expect_refused("a.db3", "", {"empty"});
}

TEST_F(BadBag, WrongMagic) {
  expect_refused("a.bag", "hello, I am a text", {"not a ROS 1 bag"});
  expect_refused("a.db3", "hello, I am a text", {"not a ROS 2 bag"});
  expect_refused("a.bag", "#ROSBAG V1.2\nand so on", {"format", "rosbag"});
  expect_refused("a.mcap", "hello, I am a text", {"not a ROS 2 bag"});
}

TEST_F(BadBag, HeaderWithAbsurdLengths) {
  for (const char* const length : {"\xFF\xFF\xFF\xFF", "\xFF\xFF\xFF\x0F", "\x10\0\0\0"})
    expect_refused("a.bag", "#ROSBAG V2.0\n" + std::string(length, 4) + std::string(100, '\x7F'), {"header"});
  expect_refused("a.bag", "#ROSBAG V2.0\n", {"header"});
}

TEST_F(BadBag, DatabaseOfSomethingElse) {
  write_db3(folder_ / "a.db3", {}, "cdr");
  expect_refused("a.db3", {"hesai_ros_driver/UdpFrame in it, but no topics"});
  std::string bytes = read_text(folder_ / "a.db3");
  for (std::size_t i = 100; i < bytes.size(); ++i)
    bytes[i] = static_cast<char>(bytes[i] + 1);
  expect_refused("b.db3", bytes, {"not a ROS 2 bag, or damaged"});
}

/// A view can have infinitely many rows.
TEST_F(BadBag, DatabaseWithAViewForATable) {
  sqlite3* database = nullptr;
  ASSERT_EQ(sqlite3_open((folder_ / "a.db3").c_str(), &database), SQLITE_OK);
  EXPECT_EQ(sqlite3_exec(database,
                         "CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT, type TEXT, serialization_format TEXT);"
                         "INSERT INTO topics VALUES (1, '/imu', 'sensor_msgs/msg/Imu', 'cdr');"
                         "CREATE VIEW messages AS WITH RECURSIVE row(n) AS (SELECT 1 UNION ALL SELECT n + 1 FROM row) "
                         "SELECT n AS id, 2 AS topic_id, n AS timestamp, x'00' AS data FROM row;",
                         nullptr, nullptr, nullptr),
            SQLITE_OK);
  sqlite3_close(database);
  expect_refused("a.db3", {"not a ROS 2 bag, or damaged"});
}

TEST_F(BadBag, MoreFilesThanMayBeOpenAreReportedAsSuch) {
  std::filesystem::create_directories(folder_ / "drive");
  const std::span<const RecordedMessage> messages = room_messages(RosVersion::ros2);
  constexpr std::size_t kFiles = 40;
  for (std::size_t i = 0; i < kFiles; ++i) {
    const std::size_t begin = i * messages.size() / kFiles, end = (i + 1) * messages.size() / kFiles;
    write_text(folder_ / ("drive/drive_" + std::to_string(i) + ".mcap"),
               mcap_file(messages.subspan(begin, end - begin), RosVersion::ros2));
  }
  const auto replay_with = [&](const std::string& limit) {
    return run_program("/bin/sh", {"-c", limit + " && exec " + LOCUS_REPLAY + " --quiet -o " +
                                             (folder_ / "out").string() + " " + (folder_ / "drive").string()});
  };
  const ProgramRun none_left = replay_with("ulimit -n 30");
  EXPECT_EQ(none_left.status, 1);
  EXPECT_EQ(lines_of(none_left.err).size(), 1U) << none_left.err;
  expect_line(none_left.err, {".mcap: cannot be read (Too many open files); allow more with: ulimit -n"});
  const ProgramRun asks = replay_with("ulimit -Sn 30");
  EXPECT_EQ(asks.status, 0) << asks.err;
}

TEST_F(BadBag, TopicWithAnAbsurdNameIsRejected) {
  std::vector<RecordedMessage> messages(2, room_messages(RosVersion::ros2).front());
  messages.front().topic = "/" + std::string(4096, 'x');
  write_text(folder_ / "a.bag", ros1_bag(messages));
  write_db3(folder_ / "a.db3", messages);
  for (const char* const name : {"a.bag", "a.db3"}) {
    const auto bag = tools::open_bag(folder_ / name);
    ASSERT_TRUE(bag) << bag.error();
    int seen = 0;
    while (const tools::BagMessage* message = (*bag)->next()) {
      EXPECT_EQ((*bag)->topics().at(message->topic).name, messages.back().topic);
      ++seen;
    }
    EXPECT_EQ(seen, 1);
    ASSERT_EQ((*bag)->warnings().size(), 1U);
    expect_line((*bag)->warnings().front(), {name, "more than 4096 bytes"});
  }
}

TEST_F(BadBag, Ros2BagWithUnsupportedSerialisation) {
  write_db3(folder_ / "odd.db3", std::vector{room_messages(RosVersion::ros2).front()}, "a\nb\x1B");
  expect_refused("odd.db3", {"\"a?b?\""});
  write_db3(folder_ / "flat.db3", std::vector{room_messages(RosVersion::ros2).front()}, "flatbuffers");
  expect_refused("flat.db3", {"flatbuffers"});
}

TEST_F(BadBag, IncompleteRos2Folder) {
  const auto metadata = [&](const std::string& text) {
    std::filesystem::create_directories(folder_ / "drive");
    write_text(folder_ / "drive/metadata.yaml", "rosbag2_bagfile_information:\n" + text);
  };
  metadata("  relative_file_paths: [drive_0.db3]\n");
  expect_refused("drive", {"drive_0.db3", "no such file"});
  metadata("  storage_identifier: my_own\n  relative_file_paths: [drive_0.own]\n");
  expect_refused("drive", {"storage my_own is not read", "ros2 bag convert"});
  metadata("  relative_file_paths: 7\n");
  expect_refused("drive", {"metadata.yaml", "ros2 bag reindex"});
  metadata("  {{{\n");
  expect_refused("drive", {"metadata.yaml", "ros2 bag reindex"});
  for (const auto& [file, start, said] : {std::tuple{"drive_0.mcap", "\x89MCAP0\r\n", "was not closed"},
                                          {"drive_0.db3.zstd", "\x28\xB5\x2F\xFD", "not a ROS 2 bag"}}) {
    std::filesystem::remove_all(folder_ / "drive");
    std::filesystem::create_directories(folder_ / "drive");
    write_text(folder_ / "drive" / file, start);
    expect_refused("drive", {file, said});
  }
}

TEST_F(BadBag, BagWithoutLidarListsItsTopics) {
  std::vector<RecordedMessage> messages = room_messages(RosVersion::ros1);
  std::erase_if(messages, [](const RecordedMessage& m) { return m.topic.ends_with("packets"); });
  messages.push_back({"/image_raw", "sensor_msgs/Image", messages.back().recorded, {}});
  expect_refused("a.bag", ros1_bag(messages),
                 {"no velodyne_msgs/VelodyneScan", "/imu/data (sensor_msgs/Imu)", "/image_raw (sensor_msgs/Image)"});
}

/// Messages of the Nebula drivers, including that for Velodyne.
TEST(Bags, NebulaPacketsGiveTheBitsOfAVelodyneScan) {
  const TemporaryFolder folder;
  for (const RosVersion ros : {RosVersion::ros1, RosVersion::ros2}) {
    std::vector<RecordedMessage> messages = room_messages(ros), nebula = messages_of(room_drive(), ros, nebula_message);
    ASSERT_EQ(nebula.size(), messages.size());
    for (RecordedMessage& message : nebula) {
      if (message.type == "velodyne_msgs/VelodyneScan")
        message.type = "nebula_msgs/NebulaPackets";
    }
    write_text(folder / "scans.mcap", mcap_file(messages, ros));
    write_text(folder / "nebula.mcap", mcap_file(nebula, ros));
    const Replay scans = replay_room(folder / "scans.mcap"), packets = replay_room(folder / "nebula.mcap");
    EXPECT_EQ(packets.run().err, "");
    EXPECT_EQ(read_text(packets.file("odometry.csv")), read_text(scans.file("odometry.csv")));
  }
}

/// Packets in the messages of Hesai's drivers; only the newest begins with a header.
TEST(BagMessages, OfHesaiDriversGiveTheirPackets) {
  for (const RosVersion ros : {RosVersion::ros1, RosVersion::ros2}) {
    std::vector<ReceivedPacket> packets;
    for (const std::size_t size : {1262U, 568U, 1U})
      packets.push_back({stamp_from_ns(static_cast<std::int64_t>(1'700'000'000'000'000'000 + size)),
                         std::vector<std::byte>(size, std::byte{static_cast<unsigned char>(size)})});
    for (const auto& [type, message] :
         {std::pair{"pandar_msgs/PandarScan", pandar_message(packets, ros)},
          std::pair{"hesai_ros_driver/UdpFrame", hesai_message(packets, ros)},
          std::pair{"hesai_ros_driver/UdpFrame", hesai_message(packets, ros, HesaiHeaders::of_packets)}}) {
      const auto read =
          tools::packet_type(type)->read({message, ros == RosVersion::ros1 ? Serialisation::ros1 : Serialisation::cdr});
      ASSERT_TRUE(read) << type;
      ASSERT_EQ(read->packets.size(), packets.size()) << type;
      for (std::size_t i = 0; i < packets.size(); ++i) {
        EXPECT_EQ(read->packets[i].stamp, packets[i].stamp);
        EXPECT_TRUE(std::ranges::equal(read->payload(read->packets[i]), packets[i].payload));
      }
    }
  }
}

TEST_F(BadBag, TruncatedScans) {
  std::vector<RecordedMessage> messages{
      *std::ranges::find(room_messages(RosVersion::ros1), "velodyne_msgs/VelodyneScan", &RecordedMessage::type)};
  messages.front().data.resize(2000);
  write_text(folder_ / "a.bag", ros1_bag(messages));
  const ProgramRun run = run_program(LOCUS_REPLAY, {"-o", folder_ / "out", folder_ / "a.bag"});
  EXPECT_EQ(run.status, 1);
  expect_line(run.err, {"1 of 1 messages", "are truncated", "no whole packet or cloud in 1 messages"});
}

TEST(BagChunk, WithNothingToDecompressIsDamaged) {
  for (const char* compression : {"lz4", "bz2"}) {
    const std::string fields = "\x0f\0\0\0compression="s + compression + "\x09\0\0\0size=\x10\0\0\0"s;
    std::vector<std::byte> chunk;
    EXPECT_EQ(tools::decompress_chunk({tools::BagFields(std::as_bytes(std::span(fields))), {}}, chunk),
              "a chunk is damaged")
        << compression;
  }
}

/// Lengths in a message are checked against its end.
TEST(BagMessages, AbsurdCountsAndTruncatedMessagesAreRejected) {
  for (const RosVersion ros : {RosVersion::ros1, RosVersion::ros2}) {
    const auto serialisation = ros == RosVersion::ros1 ? Serialisation::ros1 : Serialisation::cdr;
    const ReceivedPacket packet{stamp_from_ns(5), std::vector<std::byte>(1206)};
    const std::vector<std::byte> imu = imu_message({}, ros), odometry = odometry_message({}, ros);
    ASSERT_TRUE(tools::read_imu({imu, serialisation}));
    ASSERT_TRUE(tools::read_odometry({odometry, serialisation}));
    for (std::size_t length = 0; length < imu.size(); ++length)
      EXPECT_FALSE(tools::read_imu({std::span(imu).first(length), serialisation})) << length;
    for (std::size_t length = 0; length < odometry.size(); ++length)
      EXPECT_FALSE(tools::read_odometry({std::span(odometry).first(length), serialisation})) << length;
    for (const auto& message : {std::pair{"velodyne_msgs/VelodyneScan", scan_message({&packet, 1}, ros)},
                                std::pair{"nebula_msgs/NebulaPackets", nebula_message({&packet, 1}, ros)},
                                std::pair{"pandar_msgs/PandarScan", pandar_message({&packet, 1}, ros)},
                                std::pair{"hesai_ros_driver/UdpFrame", hesai_message({&packet, 1}, ros)}}) {
      const std::vector<std::byte>& scan = message.second;
      const auto read = [&](std::span<const std::byte> data) {
        return tools::packet_type(message.first)->read({data, serialisation});
      };
      ASSERT_TRUE(read(scan));
      for (std::size_t length = 0; length < scan.size(); ++length)
        EXPECT_FALSE(read(std::span(scan).first(length))) << length;
      for (std::size_t at = 0; at + 4 < scan.size() - packet.payload.size(); ++at) {
        std::vector<std::byte> absurd = scan;
        std::fill_n(absurd.begin() + static_cast<std::ptrdiff_t>(at), 4, std::byte{0xFF});
        static_cast<void>(read(absurd));
      }
    }
  }
}

/// Stamps that are unset or of another clock, and NaN, as in bags of real robots.
TEST(Bags, StampsOfAnotherClockAndNanAreTolerated) {
  const TemporaryFolder folder;
  std::vector<RecordedMessage> messages = room_messages(RosVersion::ros1);
  for (RecordedMessage& message : messages)
    message.recorded += std::chrono::hours{24 * 365}; // replayed and recorded again, a year later
  write_text(folder / "again.bag", ros1_bag(messages));
  expect_same_odometry(replay_room(folder / "again.bag"));

  messages = room_messages(RosVersion::ros1);
  for (std::size_t i = 0; i < messages.size(); ++i) {
    if (messages[i].type != "sensor_msgs/Imu" || i % 3 != 0)
      continue;
    ImuSample sample;
    sample.stamp = i % 2 == 0 ? Stamp{} : messages[i].recorded - seconds{1};
    sample.angular_velocity_radps.x() = std::numeric_limits<double>::quiet_NaN();
    messages[i].data = imu_message(sample, RosVersion::ros1);
  }
  std::reverse(messages.begin() + 100, messages.begin() + 300);
  write_text(folder / "wild.bag", ros1_bag(messages));
  const Replay replay = replay_room(folder / "wild.bag");
  EXPECT_EQ(replay.run().status, 0) << replay.run().err;
  EXPECT_GT(replay.trajectory().size(), 70U);
  EXPECT_GT(replay.summary()["sources"]["imu"]["rejected"]["nan"], 0);
}

} // namespace
} // namespace locus::test
