// SPDX-License-Identifier: Apache-2.0
// Configurations that locus-replay finds in recordings.
#include <algorithm>
#include <cstring>
#include <fstream>
#include <stdexcept>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "bag_writer.hpp"
#include "config/config_yaml.hpp"
#include "replay_run.hpp"
#include "support/clouds.hpp"
#include "support/errors.hpp"
#include "support/test_drives.hpp"

namespace locus::test {
namespace {

using std::chrono::seconds;
using Messages = std::vector<RecordedMessage>;

constexpr RosVersion kRos = RosVersion::ros1;

/// Angles without an exact representation in degrees.
const Pose kMast{from_rpy_rad({0.0123, -0.0456, 0.789}), {0.2, 0.01, 0.6}};
const Pose kBox{from_rpy_rad({0.01, 0.02, -0.03}), {0.1, 0, 0.3}};

const Messages& room_messages() {
  static const Messages messages = messages_of(room_drive(), kRos);
  return messages;
}

RecordedMessage transform(const std::string& parent, const std::string& child, const Pose& T_parent_child) {
  return {"/tf_static", "tf2_msgs/TFMessage", room_messages().front().recorded,
          transform_message(parent, child, T_parent_child, kRos)};
}

/// Replaces a name in a serialised message by another of the same length.
void rename(RecordedMessage& message, std::string_view from, std::string_view to) {
  ASSERT_EQ(from.size(), to.size());
  const auto bytes = std::as_bytes(std::span(from));
  const auto found = std::search(message.data.begin(), message.data.end(), bytes.begin(), bytes.end());
  ASSERT_NE(found, message.data.end()) << message.topic;
  std::memcpy(&*found, to.data(), to.size());
}

class Discover : public testing::Test {
 protected:
  [[nodiscard]] std::string bag_of(const Messages& messages) const {
    std::string file = folder_ / "drive.bag";
    std::ofstream{file, std::ios::binary} << ros1_bag(messages);
    return file;
  }

  /// Returns the proposal, which the configuration's own reader accepts.
  static std::string discover(const std::string& recording) {
    const ProgramRun run = run_program(LOCUS_REPLAY, {"--discover", recording});
    EXPECT_EQ(run.status, 0) << run.err;
    EXPECT_TRUE(parse_config(run.out, "proposal")) << run.out;
    return run.out;
  }
  static Config config_of(const std::string& proposal) {
    Expected<Config, ConfigErrors> config = parse_config(proposal, "proposal");
    if (!config)
      throw std::runtime_error(proposal);
    return *std::move(config);
  }

  /// Expects the same results with the proposal as without a configuration, and no warnings.
  void expect_same_bits(const std::string& recording) const {
    std::string file = folder_ / "found.yaml";
    const std::string proposal = discover(recording);
    std::ofstream{file} << proposal;
    const Replay without({recording}), with({"-c", file, recording});
    EXPECT_EQ(without.run().status, 0) << without.run().err;
    EXPECT_EQ(with.run().status, 0) << with.run().err;
    EXPECT_EQ(with.run().err, without.run().err) << proposal;
    for (const char* const name : {"odometry.tum", "map.pcd"})
      EXPECT_TRUE(read_text(with.file(name)) == read_text(without.file(name))) << name << "\n" << proposal;
  }

  TemporaryFolder folder_;
};

void expect_lines(const std::string& text, const std::vector<std::string>& lines) {
  for (const std::string& line : lines)
    EXPECT_TRUE(contains(text, line)) << "no '" << line << "' in:\n" << text;
}

TEST_F(Discover, ProposalForACaptureGivesTheSameBits) {
  std::filesystem::copy(room_drive() / "lidar.pcap", folder_ / "lidar.pcap");
  expect_same_bits(folder_ / "lidar.pcap");
  expect_lines(discover(folder_ / "lidar.pcap"),
               {"  - name: front\n", "port: 2368  # VLP-16 at 192.168.1.201, strongest returns, 600 rpm, PPS",
                "T_base_lidar: {xyz_m: [0, 0, 0], rpy_deg: [0, 0, 0]}  # not in the recording",
                "motion_sources: []  # no IMU or odometry",
                "  # - name: wio  # not used: nothing of its kind in the recording\n"});
}

TEST_F(Discover, ProposalForACaptureFolderGivesTheSameBits) {
  for (const char* const name : {"lidar.pcap", "imu.csv", "wio.tum"})
    std::filesystem::copy(room_drive() / name, folder_ / name);
  expect_same_bits(folder_.path());
  expect_lines(discover(folder_.path()), {"  - name: wio  # samples in ", "  - name: imu  # samples in "});
}

TEST_F(Discover, ProposalForPacketsInABagGivesTheSameBits) {
  Messages messages = room_messages();
  messages.insert(messages.begin(),
                  {transform("base_link", "velodyne", kMast), transform("base_link", "imu_link", kBox)});
  const std::string bag = bag_of(messages);
  expect_same_bits(bag);
  expect_lines(discover(bag),
               {"  - name: front  # packets on /2368/velodyne_packets (velodyne_msgs/VelodyneScan)\n",
                "# velodyne on base_link, by /tf_static\n", "# imu_link on base_link, by /tf_static\n",
                "topic: /imu/data  # sensor_msgs/Imu, 200 Hz, measures 9.8", "in m/s^2, as required; the only one\n",
                "topic: /wheel_odometry  # nav_msgs/Odometry, "});
}

TEST_F(Discover, ProposalForCloudsWithImuAndOdometryGivesTheSameBits) {
  std::vector<OwnCloud> clouds;
  std::vector<Stamp> ends;
  for (const CloudTurn& turn : turns_of(room_drive() / "lidar.pcap", 0)) {
    clouds.push_back(cloud_of(turn, CloudKind::velodyne));
    ends.push_back(turn.end());
  }
  Messages messages = messages_of(room_drive(), clouds, ends, kRos);
  for (RecordedMessage& message : messages)
    if (message.topic == "/imu/data")
      message.topic = "/mti/sensor";
  messages.insert(messages.begin(), {transform("base_link", "lidar", kMast), transform("lidar", "imu_link", kBox)});
  const std::string bag = bag_of(messages);
  expect_same_bits(bag);
  expect_lines(discover(bag), {"topic: /points  # sensor_msgs/PointCloud2, ", " points each; no packets\n",
                               "# lidar on base_link, by /tf_static\n", "topic: /mti/sensor  # sensor_msgs/Imu"});
}

TEST_F(Discover, SecondCandidateForARoleIsCommentedOutWithTheReason) {
  Messages messages;
  for (const RecordedMessage& message : room_messages()) {
    RecordedMessage other = message;
    if (message.topic == "/wheel_odometry") {
      other.topic = "/arm/odometry";
      OdometrySample standing;
      standing.stamp = message.recorded;
      other.data = odometry_message(standing, kRos);
      messages.push_back(other);
      other = message;
      other.topic = "/lio_sam/mapping/odometry";
      messages.push_back(other);
      other.topic = "/odom";
    } else if (message.topic == "/imu/data") {
      other.topic = "/camera/imu";
      rename(other, "imu_link", "cam_link");
      messages.push_back(other);
      other = message;
      other.topic = "/mti/imu";
    }
    messages.push_back(other);
  }
  messages.insert(messages.begin(), transform("base_link", "imu_link", kBox));
  const std::string bag = bag_of(messages), proposal = discover(bag);
  expect_lines(proposal,
               {"    topic: /odom  # ", "    topic: /mti/imu  # ", "  #   topic: /arm/odometry\n",
                "moves 0.00 m at most, /odom moves with the robot\n", "  #   topic: /lio_sam/mapping/odometry\n",
                "by its name a result of lidar, whose errors it repeats, or the truth\n", "  #   topic: /camera/imu\n",
                "/tf_static does not place its frame 'cam_link' on the robot, but that of /mti/imu\n"});
  const Replay replay({"--duration", "2", bag});
  EXPECT_EQ(replay.run().err, "") << "the choice needs no answer";
  expect_lines(replay.run().out, {"/odom is wio, /mti/imu is imu"});
}

TEST_F(Discover, AccelerationsInAnotherUnitAreReported) {
  Messages messages = room_messages();
  auto samples = MotionSamples<ImuSample>::open(room_drive() / "imu.csv");
  ASSERT_TRUE(samples);
  std::erase_if(messages, [](const RecordedMessage& message) { return message.topic == "/imu/data"; });
  for (ImuSample& sample : samples->drain()) {
    sample.specific_force_mps2 /= kGravity_mps2;
    messages.push_back({"/imu/data", "sensor_msgs/Imu", sample.arrival, imu_message(sample, kRos)});
  }
  std::ranges::stable_sort(messages, {}, &RecordedMessage::recorded);
  expect_lines(discover(bag_of(messages)), {"measures 1.00 in the mean, so in g and not in m/s^2"});
}

TEST_F(Discover, ImuThatIsTooSlowIsReportedAndTheLastChoice) {
  Messages slow;
  for (std::size_t imu = 0; const RecordedMessage& message : room_messages())
    if (message.topic != "/imu/data" || imu++ % 10 == 0)
      slow.push_back(message);
  expect_lines(discover(bag_of(slow)),
               {"topic: /imu/data  # sensor_msgs/Imu, 20 Hz (too slow to be used, 29 Hz are needed), "});

  for (RecordedMessage message : room_messages())
    if (message.topic == "/imu/data") {
      message.topic = "/mti/imu";
      slow.push_back(message);
    }
  std::ranges::stable_sort(slow, {}, &RecordedMessage::recorded);
  expect_lines(discover(bag_of(slow)), {"topic: /mti/imu  # sensor_msgs/Imu, 200 Hz, measures",
                                        "  #   topic: /imu/data\n", "20 messages a second are too few to be used"});
}

TEST_F(Discover, LidarsOfABagAreThoseThatAreMountedOnTheRobot) {
  write_room_drive(folder_ / "capture", seconds{3}, 2);
  Messages messages = messages_of(folder_ / "capture", kRos);
  for (RecordedMessage& message : messages) {
    if (message.topic.starts_with("/2369"))
      rename(message, "velodyne", "velodyn2");
    if (message.topic.starts_with("/236"))
      message.topic = message.topic.starts_with("/2368") ? "/front/velodyne_packets" : "/rear/velodyne_packets";
  }
  const std::string alone = discover(bag_of(messages));
  EXPECT_EQ(config_of(alone).lidars.size(), 1U) << alone;
  expect_lines(alone, {"  - name: front  # packets on /front/velodyne_packets", "  # - name: rear  # not used: packets",
                       "/tf_static does not place its lidar on the robot: measure and add T_base_lidar\n"});
  messages.insert(messages.begin(),
                  {transform("base_link", "velodyne", kMast), transform("base_link", "velodyn2", kBox)});
  const std::string bag = bag_of(messages), both = discover(bag);
  ASSERT_EQ(config_of(both).lidars.size(), 2U) << both;
  EXPECT_EQ(config_of(both).lidars[1].name, "rear");
  expect_same_bits(bag);
}

TEST_F(Discover, SecondLidarOfACaptureIsCommentedOut) {
  write_room_drive(folder_ / "capture", seconds{2}, 2);
  EXPECT_EQ(config_of(discover(folder_ / "capture")).lidars.size(), 2U) << "the folder has a configuration";
  std::filesystem::rename(folder_ / "capture/lidar.pcap", folder_ / "both.pcap");
  expect_lines(discover(folder_ / "both.pcap"), {"  # - name: lidar2  # not used: VLP-16 at 192.168.1.202",
                                                 "  #   port: 2369\n", "measure and add T_base_lidar"});
}

TEST_F(Discover, PortOfACaptureIsFound) {
  sim::RobotOptions robot;
  robot.lidars.front().options.port = 2375;
  sim::write_capture_folder(folder_ / "capture", sim::room(),
                            sim::Trajectory(sim::room_course(seconds{2}, 1.0), sim::room_start()), seconds{2}, robot);
  std::filesystem::rename(folder_ / "capture/lidar.pcap", folder_ / "drive.pcap");
  expect_same_bits(folder_ / "drive.pcap");
  const Replay replay({folder_ / "drive.pcap"});
  expect_lines(replay.run().out, {"lidar front is VLP-16 at 192.168.1.201, which sends to port 2375\n"});
}

TEST_F(Discover, BaseIsTheBodyOfTheOdometryIfThereIsNoOther) {
  Messages messages = room_messages();
  for (RecordedMessage& message : messages)
    if (message.topic == "/wheel_odometry")
      rename(message, "base_link", "base_foot");
  messages.insert(messages.begin(), transform("base_foot", "velodyne", kMast));
  const std::string bag = bag_of(messages);
  expect_lines(discover(bag), {"  frame_base: base_foot  # of the odometry; /tf_static connects it with the lidar, but "
                               "not base_link\n",
                               "# velodyne on base_foot, by /tf_static\n"});
  expect_same_bits(bag);
}

TEST_F(Discover, LidarWhoseMessagesNameNoFrameIsTheBase) {
  constexpr std::size_t kLength = 12, kName = 16; // in a header of ROS 1
  Messages messages = room_messages();
  for (RecordedMessage& message : messages) {
    if (message.type != "velodyne_msgs/VelodyneScan")
      continue;
    const auto name = message.data.begin() + kName;
    message.data.erase(name, name + static_cast<std::ptrdiff_t>(std::string_view("velodyne").size()));
    std::fill_n(message.data.begin() + kLength, kName - kLength, std::byte{0});
  }
  const std::string bag = bag_of(messages);
  expect_lines(discover(bag), {"# messages of the lidar name no frame: poses are those of the lidar\n",
                               "# /tf_static does not connect 'imu_link' with the lidar: measure it"});
  const Replay replay({"--duration", "1", bag});
  expect_lines(replay.run().out, {"no mounting of the lidar on base_link, so poses are those of the lidar; set it",
                                  "no mounting of imu (imu_link) on the lidar, so its axes are assumed to be those of "
                                  "the lidar; set it with --set motion_sources.imu."});
}

TEST_F(Discover, NamesInARecordingCannotAddKeys) {
  Messages messages = room_messages();
  for (RecordedMessage& message : messages)
    if (message.topic == "/imu/data")
      rename(message, "imu_link", "a\nb: {c}");
  messages.insert(messages.begin(),
                  {transform("base_link", "velodyne", kMast), transform("base_link", "a\nb: {c}", kBox)});
  expect_lines(discover(bag_of(messages)), {"# a?b: {c} on base_link, by /tf_static\n"});
}

TEST_F(Discover, RecordingWithoutLidarIsAnError) {
  std::ofstream{folder_ / "empty.pcap", std::ios::binary} << read_text(room_drive() / "lidar.pcap").substr(0, 24);
  const ProgramRun run = run_program(LOCUS_REPLAY, {"--discover", folder_ / "empty.pcap"});
  EXPECT_EQ(run.status, 1);
  EXPECT_EQ(run.out, "");
  expect_lines(run.err, {"no lidar that can be read is in its first packets"});
  const ProgramRun standard_input = run_program(LOCUS_REPLAY, {"--discover", "-"});
  EXPECT_EQ(standard_input.status, 2);
  expect_lines(standard_input.err, {"--discover: standard input cannot be read several times"});
}

} // namespace
} // namespace locus::test
