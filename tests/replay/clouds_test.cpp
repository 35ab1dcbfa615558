// SPDX-License-Identifier: Apache-2.0
// Bags with clouds in place of packets, made from the packets of a drive in the formats of lidar drivers.
#include <algorithm>
#include <fstream>
#include <functional>
#include <random>
#include <variant>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "bag_writer.hpp"
#include "daemon/inline_pipeline.hpp"
#include "replay_run.hpp"
#include "support/clouds.hpp"
#include "support/test_drives.hpp"

namespace locus::test {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;
using Type = CloudView::Type;
using Change = std::function<void(OwnCloud&)>;

/// Skips the standstill: the robot starts in the third second, and micrometres decide whether it is still at rest. The
/// messages of packets to compare with are reduced by the same number.
constexpr std::size_t kScansLeftOut = 35, kPacketsInScan = 76;

/// Lidar alone, for equal results: motion samples received during a turn are available when its cloud arrives, but not
/// yet when its packets do.
const std::string kLidarAlone = "motion_sources=[]";

const std::vector<CloudTurn>& room_turns() {
  static const std::vector<CloudTurn> turns = turns_of(room_drive() / "lidar.pcap", kScansLeftOut * kPacketsInScan);
  return turns;
}

void write_file(const std::filesystem::path& file, const std::string& text) {
  std::ofstream{file, std::ios::binary} << text;
}

void expect_parts(const std::string& text, const std::vector<std::string>& parts) {
  for (const std::string& part : parts)
    EXPECT_NE(text.find(part), std::string::npos) << "no '" << part << "' in: " << text;
}

/// Returns `count` clouds of the drive around the room, with its motion.
std::vector<RecordedMessage> room_clouds(CloudKind kind, RosVersion ros, const Change& change = {},
                                         std::size_t count = SIZE_MAX) {
  std::vector<OwnCloud> clouds;
  std::vector<Stamp> ends;
  for (const CloudTurn& turn : room_turns()) {
    if (clouds.size() == count)
      break;
    OwnCloud& cloud = clouds.emplace_back(cloud_of(turn, kind));
    if (change)
      change(cloud);
    ends.push_back(turn.end());
  }
  return messages_of(room_drive(), clouds, ends, ros);
}

/// Trajectory from packets, also without configuration: the lidar is the base.
const std::vector<StampedPose>& trajectory_of_packets() {
  static const std::vector<StampedPose> trajectory = [] {
    const TemporaryFolder folder;
    std::vector<RecordedMessage> messages = messages_of(room_drive(), RosVersion::ros1);
    std::size_t scans = 0;
    std::erase_if(messages, [&](const RecordedMessage& message) {
      return message.topic.ends_with("packets") && scans++ < kScansLeftOut;
    });
    write_file(folder / "packets.bag", ros1_bag(messages));
    return Replay({"--set", kLidarAlone, folder / "packets.bag"}).trajectory();
  }();
  return trajectory;
}

/// Returns the offset from the stamp of the nearest pose of the packet trajectory.
double off_packets_s(const StampedPose& pose) {
  double nearest_s = 1e9;
  for (const StampedPose& of_packets : trajectory_of_packets())
    if (const double off_s = to_seconds(pose.stamp - of_packets.stamp); std::abs(off_s) < std::abs(nearest_s))
      nearest_s = off_s;
  return nearest_s;
}

/// Returns the largest distance from the packet trajectory, which is interpolated.
double farthest_from_packets_m(const std::vector<StampedPose>& trajectory) {
  constexpr double kMost_s = 0.001; ///< a cloud ends with its last point, a sweep of packets with the turn
  const std::vector<StampedPose>& packets = trajectory_of_packets();
  double farthest_m = trajectory.size() + 1 < packets.size() ? 1e9 : 0;
  for (const StampedPose& pose : trajectory) {
    const auto nearest = std::ranges::min_element(
        packets, {}, [&](const StampedPose& p) { return std::abs(to_seconds(p.stamp - pose.stamp)); });
    const auto next = std::next(nearest) == packets.end() ? std::prev(nearest) : std::next(nearest);
    const double off_s = to_seconds(pose.stamp - nearest->stamp);
    if (std::abs(off_s) > kMost_s && pose.stamp != trajectory.back().stamp)
      return 1e9;
    const Eigen::Vector3d speed_mps = (next->T_source_base.translation - nearest->T_source_base.translation) /
                                      to_seconds(next->stamp - nearest->stamp);
    const Eigen::Vector3d expected_m = nearest->T_source_base.translation + off_s * speed_mps;
    farthest_m = std::max(farthest_m, (pose.T_source_base.translation - expected_m).norm());
  }
  return farthest_m;
}

class CloudsOf : public testing::TestWithParam<int> {
 protected:
  [[nodiscard]] static CloudKind kind() { return static_cast<CloudKind>(GetParam()); }
};

TEST_P(CloudsOf, Ros1BagGivesTheTrajectoryOfThePackets) {
  const TemporaryFolder folder;
  write_file(folder / "clouds.bag", ros1_bag(room_clouds(kind(), RosVersion::ros1)));
  const Replay replay({"--set", kLidarAlone, folder / "clouds.bag"});
  ASSERT_EQ(replay.run().status, 0) << replay.run().err;
  EXPECT_LT(farthest_from_packets_m(replay.trajectory()), 0.001);
  if (kind() != CloudKind::bare) {
    EXPECT_EQ(replay.run().err, "");
  }
}

TEST_P(CloudsOf, Ros2BagGivesTheSameBits) {
  const TemporaryFolder folder;
  write_file(folder / "clouds.bag", ros1_bag(room_clouds(kind(), RosVersion::ros1, {}, 20)));
  write_db3(folder / "clouds.db3", room_clouds(kind(), RosVersion::ros2, {}, 20));
  const Replay ros1({folder / "clouds.bag"}), ros2({folder / "clouds.db3"});
  ASSERT_EQ(ros2.run().status, 0) << ros2.run().err;
  EXPECT_EQ(read_text(ros1.file("odometry.tum")), read_text(ros2.file("odometry.tum")));
}

TEST_P(CloudsOf, WrittenInputsReplayToTheSameBits) {
  const TemporaryFolder folder;
  write_file(folder / "clouds.bag", ros1_bag(room_clouds(kind(), RosVersion::ros1, {}, 20)));
  const Replay first({"--mcap", folder / "out.mcap", folder / "clouds.bag"}), again({folder / "out.mcap"});
  ASSERT_EQ(again.run().status, 0) << again.run().err;
  expect_parts(again.run().out, {"/points is lidar front"});
  EXPECT_TRUE(read_text(first.file("odometry.csv")) == read_text(again.file("odometry.csv")));
}

/// The service's receive path from a serialised message on, without DDS and its threads.
TEST_P(CloudsOf, LiveMessagesGiveTheTrajectoryOfThePackets) {
  if (kind() == CloudKind::livox_custom)
    GTEST_SKIP() << "no PointCloud2, and so in bags alone";
  Config config;
  config.lidars.front().topic = "/points";
  config.motion_sources.clear();
  daemon::LiveInput input({}, {true});
  std::vector<StampedPose> trajectory;
  daemon::InlinePipeline pipeline(config, *LidarRouter::open(config.lidars),
                                  [&](const Sweep&, const daemon::ProcessedSweep& done) {
                                    trajectory.push_back({done.estimate.stamp, done.estimate.T_odom_base});
                                  });
  for (const RecordedMessage& message : room_clouds(kind(), RosVersion::ros2)) {
    if (message.topic != "/points")
      continue;
    daemon::CloudBytes& next = input.next_cloud(0);
    next.arrival = message.recorded;
    next.bytes = message.data;
    input.push_cloud(0);
    const daemon::Input received = input.next(Duration::zero());
    ASSERT_TRUE(std::holds_alternative<daemon::CloudInput>(received));
    pipeline.process(received);
  }
  pipeline.process(daemon::EndOfInput{});
  EXPECT_LT(farthest_from_packets_m(trajectory), 0.001);
  EXPECT_EQ(input.cloud_drops(0), 0U);
}

INSTANTIATE_TEST_SUITE_P(Kinds, CloudsOf, testing::Range(0, kCloudKinds),
                         [](const auto& tested) { return name_of(static_cast<CloudKind>(tested.param)); });

TEST(Clouds, OneCommandWithoutConfigurationWritesTheReport) {
  const TemporaryFolder folder;
  write_file(folder / "clouds.bag", ros1_bag(room_clouds(CloudKind::velodyne, RosVersion::ros1)));
  const Replay replay({"--ground-truth", room_drive() / "gt.tum", folder / "clouds.bag"});
  ASSERT_EQ(replay.run().status, 0) << replay.run().err;
  EXPECT_EQ(replay.run().err, "");
  expect_parts(replay.run().out, {"/points is lidar front, /wheel_odometry is wio, /imu/data is imu",
                                  "no packets, so the clouds on /points are used",
                                  "/tf_static has no mounting of the lidar (lidar) on base_link"});
  EXPECT_TRUE(std::filesystem::exists(replay.file("report.html")));
  EXPECT_EQ(replay.summary()["sweeps"]["seen"], room_turns().size());
  EXPECT_EQ(replay.summary()["sweeps"]["failed"], 0);
}

TEST(Clouds, FiguresCountWhatWasReceived) {
  const TemporaryFolder folder;
  write_file(folder / "clouds.bag", ros1_bag(room_clouds(CloudKind::ouster, RosVersion::ros1)));
  const Replay replay({folder / "clouds.bag"});
  const nlohmann::json lidar = replay.summary()["lidars"]["front"];
  const nlohmann::json& clouds = lidar["clouds"];
  EXPECT_EQ(lidar["topic"], "/points");
  EXPECT_EQ(clouds["received"], room_turns().size());
  EXPECT_EQ(clouds["used"], room_turns().size());
  EXPECT_EQ(clouds["times"], "field");
  EXPECT_EQ(clouds["rings"], "field");
  EXPECT_NEAR(clouds["rate_hz"].get<double>(), 10.0, 0.01);
  EXPECT_GT(clouds["origin"], 0);
  std::size_t returns = 0;
  for (const CloudTurn& turn : room_turns())
    returns += turn.points.size();
  EXPECT_EQ(clouds["points"].get<std::size_t>() - clouds["origin"].get<std::size_t>(), returns);
  EXPECT_FALSE(replay.summary()["packets"].contains("front"));
  expect_parts(replay.run().out, {"clouds of", "times: field, rings: field"});
}

TEST(Clouds, MountingIsReadFromTheStaticTransforms) {
  const TemporaryFolder folder;
  std::vector<RecordedMessage> messages = room_clouds(CloudKind::hesai, RosVersion::ros2, {}, 10);
  const Pose T_base_mast{from_rpy_rad({0, 0, 0.5}), {0.2, 0, 0.6}},
      T_mast_lidar{from_rpy_rad({0, 0.1, 0}), {0, 0, 0.1}};
  const Stamp begin = messages.front().recorded;
  messages.insert(messages.begin(), {{"/tf_static", "tf2_msgs/TFMessage", begin,
                                      transform_message("base_link", "mast", T_base_mast, RosVersion::ros2)},
                                     {"/tf_static", "tf2_msgs/TFMessage", begin,
                                      transform_message("mast", "lidar", T_mast_lidar, RosVersion::ros2)}});
  write_db3(folder / "clouds.db3", messages);
  const Replay replay({folder / "clouds.db3"});
  ASSERT_EQ(replay.run().status, 0) << replay.run().err;
  const Eigen::Vector3d p = (T_base_mast * T_mast_lidar).translation;
  expect_parts(replay.run().out, {fmt::format("is mounted at {:.3f} {:.3f} {:.3f} m, 0.0 5.7 28.6 deg on base_link, by "
                                              "/tf_static",
                                              p.x(), p.y(), p.z())});
}

TEST(Clouds, TopicWithMostPointsIsUsedAndOthersAreNamed) {
  const TemporaryFolder folder;
  std::vector<RecordedMessage> messages = room_clouds(CloudKind::velodyne, RosVersion::ros1, {}, 10);
  CloudTurn thinned = room_turns().front();
  thinned.points.resize(thinned.points.size() / 2);
  const OwnCloud filtered = cloud_of(thinned, CloudKind::velodyne);
  messages.push_back(
      {"/filtered", type_of(filtered), messages.back().recorded, cloud_message(filtered, RosVersion::ros1)});
  write_file(folder / "clouds.bag", ros1_bag(messages));
  const Replay most({folder / "clouds.bag"});
  expect_parts(most.run().out, {"the clouds on /points are used, not /filtered", "--set lidars.0.topic=/filtered",
                                "not used: /filtered"});
  const Replay asked({"--set", "lidars.0.topic=/filtered", folder / "clouds.bag"});
  expect_parts(asked.run().out, {"/filtered is lidar front"});
  const Replay none({"--set", "lidars.0.topic=/nothing", folder / "clouds.bag"});
  EXPECT_EQ(none.run().status, 2);
  expect_parts(none.run().err, {"no clouds on /nothing", "/points (sensor_msgs/PointCloud2)"});
}

TEST(Clouds, PacketConfigurationSuggestsTheCloudTopic) {
  const TemporaryFolder folder;
  write_file(folder / "clouds.bag", ros1_bag(room_clouds(CloudKind::velodyne, RosVersion::ros1, {}, 3)));
  write_file(folder / "packets.yaml", "lidars: [{name: top}]\n");
  const Replay replay({"-c", folder / "packets.yaml", folder / "clouds.bag"});
  EXPECT_EQ(replay.run().status, 1);
  expect_parts(replay.run().err, {"no velodyne_msgs/VelodyneScan", "--set lidars.0.topic=/points"});
}

TEST(Clouds, RealtimeUsesTheThreadsOfTheDaemon) {
  const TemporaryFolder folder;
  write_file(folder / "clouds.bag", ros1_bag(room_clouds(CloudKind::velodyne, RosVersion::ros1, {}, 30)));
  const Replay replay({"--realtime=2", folder / "clouds.bag"});
  ASSERT_EQ(replay.run().status, 0) << replay.run().err;
  EXPECT_EQ(replay.summary()["sweeps"]["seen"], 30);
  EXPECT_EQ(replay.summary()["lidars"]["front"]["clouds"]["used"], 30);
}

TEST(Clouds, PacketFaultsAreAnError) {
  const TemporaryFolder folder;
  write_file(folder / "clouds.bag", ros1_bag(room_clouds(CloudKind::velodyne, RosVersion::ros1, {}, 3)));
  const Replay replay({"--fail", "front:lost@1-2", folder / "clouds.bag"});
  EXPECT_EQ(replay.run().status, 2);
  expect_parts(replay.run().err, {"lidar front has clouds"});
}

/// Wrong times, the expected warning, and the replacement.
struct WrongTimes {
  std::string name;
  CloudKind kind;
  Change change;
  std::string said, times;
  double within_m; ///< of the trajectory of the packets
};

/// Applies a factor and an offset to the kind's time field.
Change times_changed(const std::string& field, float factor, float plus_s) {
  return [=](OwnCloud& cloud) {
    for (std::size_t i = 0; i < cloud.width; ++i)
      cloud.set(i, field, cloud.get<float>(i, field) * factor + plus_s);
  };
}

Change stamps_later(Duration by) {
  return [by](OwnCloud& cloud) { cloud.stamp += by; };
}

std::vector<WrongTimes> wrong_times() {
  const auto without = [](OwnCloud& cloud) { remove_field(cloud, "time"); };
  const auto shuffled = [](OwnCloud& cloud) {
    std::mt19937 random(1);
    std::vector<float> times;
    for (std::size_t i = 0; i < cloud.width; ++i)
      times.push_back(cloud.get<float>(i, "time"));
    std::ranges::shuffle(times, random);
    for (std::size_t i = 0; i < cloud.width; ++i)
      cloud.set(i, "time", times[i]);
  };
  const auto at_end = [](OwnCloud& cloud) { cloud.stamp += milliseconds{100}; };
  return {{"missing", CloudKind::velodyne_start, without, "have no field of times", "azimuth", 0.001},
          {"equal", CloudKind::velodyne_start, times_changed("time", 0, 0), "all have the same time", "azimuth", 0.001},
          {"shuffled", CloudKind::velodyne_start, shuffled, "are not monotonic along a ring", "azimuth", 0.001},
          {"wrong_unit", CloudKind::velodyne_start, times_changed("time", 5, 0), "do not span a revolution", "azimuth",
           0.001},
          {"at_end", CloudKind::velodyne_start, at_end, "arrive before their last point", "field", 0.001},
          {"tai", CloudKind::velodyne_start, stamps_later(seconds{37}), "37 s ahead", "field", 0.01},
          {"future", CloudKind::velodyne_start, stamps_later(seconds{5}), "in the future", "field", 0.01},
          {"boot_time", CloudKind::velodyne_start, stamps_later(seconds{-1'600'000'000}), "of another clock", "field",
           0.01}};
}

class CloudTimes : public testing::TestWithParam<WrongTimes> {};

TEST_P(CloudTimes, WrongTimesAreReportedInTheFirstSecondAndReplaced) {
  const WrongTimes& wrong = GetParam();
  const TemporaryFolder folder;
  write_file(folder / "clouds.bag", ros1_bag(room_clouds(wrong.kind, RosVersion::ros1, wrong.change)));
  const Replay first_second({"--duration", "1", folder / "clouds.bag"});
  EXPECT_EQ(first_second.run().status, 0);
  expect_parts(first_second.run().err, {"lidar front", wrong.said});
  const Replay whole({"--set", kLidarAlone, folder / "clouds.bag"});
  ASSERT_EQ(whole.run().status, 0) << whole.run().err;
  EXPECT_EQ(whole.summary()["lidars"]["front"]["clouds"]["times"], wrong.times);
  // Stamps of another clock are late by the message's latency, and the first clouds are used to estimate that clock.
  if (wrong.within_m <= 0.001) {
    EXPECT_LT(farthest_from_packets_m(whole.trajectory()), wrong.within_m);
  } else {
    constexpr double kMost_s = 0.006; // latency of a message (4 ms) + difference of the ends of cloud and turn
    for (const StampedPose& pose : whole.trajectory())
      EXPECT_LT(std::abs(off_packets_s(pose)), kMost_s) << to_ns(pose.stamp);
    EXPECT_NEAR(whole.trajectory().back().T_source_base.translation.norm(),
                trajectory_of_packets().back().T_source_base.translation.norm(), 0.1);
    EXPECT_LT(whole.summary()["lidars"]["front"]["clouds"]["refused"]["clock"], 5);
  }
}

INSTANTIATE_TEST_SUITE_P(Wrong, CloudTimes, testing::ValuesIn(wrong_times()),
                         [](const auto& tested) { return tested.param.name; });

TEST(Clouds, UserChoosesAzimuthOrOneInstant) {
  const TemporaryFolder folder;
  write_file(folder / "clouds.bag", ros1_bag(room_clouds(CloudKind::velodyne_start, RosVersion::ros1)));
  const Replay azimuth({"--set", kLidarAlone, "--set", "lidars.0.point_times=azimuth", folder / "clouds.bag"});
  EXPECT_EQ(azimuth.run().err, "");
  EXPECT_EQ(azimuth.summary()["lidars"]["front"]["clouds"]["times"], "azimuth");
  EXPECT_LT(farthest_from_packets_m(azimuth.trajectory()), 0.001);
  const Replay none({"--set", "lidars.0.point_times=none", folder / "clouds.bag"});
  EXPECT_EQ(none.run().err, "");
  EXPECT_EQ(none.summary()["lidars"]["front"]["clouds"]["times"], "instant");
  EXPECT_EQ(none.summary()["sweeps"]["failed"], 0);
}

/// One cloud in three is stamped 150 ms early, so before the one that arrives ahead of it.
TEST(Clouds, StampsGoingBackAreReportedInTheFirstSecond) {
  const TemporaryFolder folder;
  std::size_t count = 0;
  const auto early = [&](OwnCloud& cloud) { cloud.stamp -= count++ % 3 == 2 ? milliseconds{150} : milliseconds{0}; };
  write_file(folder / "clouds.bag", ros1_bag(room_clouds(CloudKind::velodyne_start, RosVersion::ros1, early)));
  const Replay replay({"--duration", "1", folder / "clouds.bag"});
  EXPECT_EQ(replay.run().status, 0);
  expect_parts(replay.run().err, {"lidar front", "go back or stand still from one to the next"});
}

TEST(Clouds, ClockStepLosesAFewClouds) {
  const TemporaryFolder folder;
  const Stamp middle = room_turns()[room_turns().size() / 2].begin;
  const auto step = [middle](OwnCloud& cloud) { cloud.stamp += cloud.stamp > middle ? seconds{-100} : seconds{0}; };
  write_file(folder / "clouds.bag", ros1_bag(room_clouds(CloudKind::velodyne_start, RosVersion::ros1, step)));
  const Replay replay({folder / "clouds.bag"});
  ASSERT_EQ(replay.run().status, 0) << replay.run().err;
  const nlohmann::json clouds = replay.summary()["lidars"]["front"]["clouds"];
  EXPECT_EQ(clouds["clock_steps"], 1);
  EXPECT_EQ(clouds["refused"]["clock"], 4);
  EXPECT_LT(
      (replay.trajectory().back().T_source_base.translation - trajectory_of_packets().back().T_source_base.translation)
          .norm(),
      0.02);
}

TEST(Clouds, LostCloudsAreDeadReckoned) {
  const TemporaryFolder folder;
  std::vector<RecordedMessage> messages = room_clouds(CloudKind::velodyne_start, RosVersion::ros1);
  std::size_t seen = 0;
  std::erase_if(messages,
                [&](const RecordedMessage& message) { return message.topic == "/points" && ++seen % 10 == 3; });
  write_file(folder / "clouds.bag", ros1_bag(messages));
  const Replay replay({folder / "clouds.bag"});
  ASSERT_EQ(replay.run().status, 0) << replay.run().err;
  EXPECT_EQ(replay.summary()["sweeps"]["failed"], 5);
  EXPECT_EQ(replay.summary()["sweeps"]["seen"], room_turns().size());
}

} // namespace
} // namespace locus::test
