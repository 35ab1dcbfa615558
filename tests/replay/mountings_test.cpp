// SPDX-License-Identifier: Apache-2.0
// Mountings of the sensors of a bag, by /tf_static and by the user.
#include <algorithm>
#include <fstream>
#include <tuple>

#include <gtest/gtest.h>

#include "bag_writer.hpp"
#include "discovery/static_transforms.hpp"
#include "replay_run.hpp"
#include "support/errors.hpp"
#include "support/test_drives.hpp"

namespace locus::test {
namespace {

/// Frames of the messages that bag_writer.hpp writes: "velodyne" and "imu_link".
struct Link {
  std::string parent, child;
  Pose T_parent_child;
};

const Pose kTurnedMast{from_rpy_rad({0, 0, 0.5}), {0.2, 0, 0.6}};
const Pose kTurned{from_rpy_rad({90 * kRadPerDeg, 0, 0}), {0.1, 0, 0.05}};
const std::string kSetTurned = "motion_sources.imu.T_base_source={xyz_m: [0.1, 0, 0.05], rpy_deg: [90, 0, 0]}";

ImuSample turned_back(ImuSample sample) {
  const Eigen::Quaterniond R_imu_base = kTurned.rotation.conjugate();
  sample.angular_velocity_radps = R_imu_base * sample.angular_velocity_radps;
  sample.specific_force_mps2 = R_imu_base * sample.specific_force_mps2;
  return sample;
}

/// Bag of the drive around the room, with an IMU mounted as kTurned and these links on /tf_static.
class Mountings : public testing::Test {
 protected:
  [[nodiscard]] std::string bag_with(const std::vector<Link>& links) const {
    static const std::vector<RecordedMessage> drive = turned_drive();
    std::vector<RecordedMessage> messages = drive;
    for (const Link& link : links)
      messages.insert(messages.begin(),
                      {"/tf_static", "tf2_msgs/TFMessage", drive.front().recorded,
                       transform_message(link.parent, link.child, link.T_parent_child, RosVersion::ros1)});
    std::string file = folder_ / "drive.bag";
    std::ofstream{file, std::ios::binary} << ros1_bag(messages);
    return file;
  }
  [[nodiscard]] std::string configuration(const std::string& yaml) const {
    std::string file = folder_ / "robot.yaml";
    std::ofstream{file} << yaml;
    return file;
  }

  TemporaryFolder folder_;

 private:
  static std::vector<RecordedMessage> turned_drive() {
    std::vector<RecordedMessage> messages = messages_of(room_drive(), RosVersion::ros1);
    std::erase_if(messages, [](const RecordedMessage& message) { return message.type == "sensor_msgs/Imu"; });
    auto samples = MotionSamples<ImuSample>::open(room_drive() / "imu.csv");
    for (const ImuSample& sample : samples->drain())
      messages.push_back(
          {"/imu/data", "sensor_msgs/Imu", sample.arrival, imu_message(turned_back(sample), RosVersion::ros1)});
    std::ranges::stable_sort(messages, {}, &RecordedMessage::recorded);
    return messages;
  }
};

/// Runs without warnings.
std::string output_of(const Replay& replay) {
  EXPECT_EQ(replay.run().status, 0);
  EXPECT_EQ(replay.run().err, "");
  return replay.run().out;
}

std::string trajectory_of(const Replay& replay) { return read_text(replay.file("odometry.tum")); }

TEST_F(Mountings, ImuRotationIsReadFromTheStaticTransforms) {
  const Replay replay({bag_with({{"base_link", "velodyne", Pose{}}, {"base_link", "imu_link", kTurned}})});
  EXPECT_TRUE(contains(output_of(replay),
                       "imu (imu_link) is mounted at 0.100 0.000 0.050 m, 90.0 0.0 0.0 deg on base_link, "
                       "by /tf_static\n"));
  const Replay set({"--set", kSetTurned, bag_with({})});
  const Replay wrong({bag_with({})});
  const auto last = [](const Replay& run) { return run.trajectory().back().T_source_base.translation; };
  EXPECT_LT((last(replay) - last(set)).norm(), 1e-4);
  EXPECT_TRUE(contains(wrong.run().err, "T_base_source")) << "the test's IMU is turned";
}

TEST_F(Mountings, ImuWithoutAMountingIsReportedUntilItsRotationIsSet) {
  const std::string unknown = "/tf_static has no mounting of imu (imu_link) on velodyne, so its axes are assumed to be "
                              "those of velodyne; set it with --set motion_sources.imu.T_base_source.rpy_deg=[ROLL,",
                    bag = bag_with({});
  const Replay replay({"--duration", "1", bag}), set({"--duration", "1", "--set", kSetTurned, bag});
  EXPECT_TRUE(contains(replay.run().out, unknown)) << replay.run().out;
  EXPECT_FALSE(contains(set.run().out, "no mounting of imu")) << set.run().out;
  EXPECT_TRUE(contains(run_program(LOCUS_REPLAY, {"--discover", bag}).out,
                       "    T_base_source: {xyz_m: [0, 0, 0], rpy_deg: [0, 0, 0]}  # /tf_static does not connect "
                       "'imu_link' with velodyne: measure it, above all its rotation\n"));
}

TEST_F(Mountings, ConfiguredMountingsAreUsed) {
  const std::string set_lidar = "lidars.0.T_base_lidar={xyz_m: [0.3, 0, 0.4], rpy_deg: [0, 0, 10]}";
  const Replay with({"--set", set_lidar, "--set", kSetTurned,
                     bag_with({{"base_link", "velodyne", kTurnedMast}, {"base_link", "imu_link", kTurnedMast}})});
  EXPECT_FALSE(contains(output_of(with), "sits")) << with.run().out;
  const Replay without({"--set", set_lidar, "--set", kSetTurned, bag_with({})});
  EXPECT_FALSE(contains(without.run().out, "sits")) << without.run().out;
  EXPECT_EQ(trajectory_of(with), trajectory_of(without));
}

TEST_F(Mountings, PartThatIsNotSetIsReadFromTheStaticTransforms) {
  const Replay replay({"--duration", "1", "--set", "lidars.0.T_base_lidar.xyz_m=[0.3, 0, 0.4]", "--set",
                       "motion_sources.imu.T_base_source.rpy_deg=[90, 0, 0]",
                       bag_with({{"base_link", "velodyne", kTurnedMast}, {"base_link", "imu_link", kTurnedMast}})});
  EXPECT_TRUE(contains(replay.run().out, "the lidar (velodyne) is mounted at 0.300 0.000 0.400 m, 0.0 0.0 28.6 deg on "
                                         "base_link, by /tf_static and --set\n"))
      << replay.run().out;
  EXPECT_TRUE(contains(replay.run().out,
                       "imu (imu_link) is mounted at 0.200 0.000 0.600 m, 90.0 0.0 0.0 deg on base_link, "
                       "by /tf_static and --set\n"));
}

TEST_F(Mountings, BaseFrameIsTheConfiguredOne) {
  const std::string bag = bag_with({{"base_link", "mast", kTurnedMast},
                                    {"mast", "velodyne", {{1, 0, 0, 0}, {0, 0, 0.1}}},
                                    {"mast", "imu_link", kTurned}});
  const std::string
      lidar = "the lidar (velodyne) is mounted at 0.000 0.000 0.100 m, 0.0 0.0 0.0 deg on mast, by /tf_static",
      imu = "imu (imu_link) is mounted at 0.100 0.000 0.050 m, 90.0 0.0 0.0 deg on mast, by /tf_static";
  const Replay set({"--duration", "1", "--set", "dds.frame_base=mast", bag});
  EXPECT_TRUE(contains(set.run().out, lidar)) << set.run().out;
  EXPECT_TRUE(contains(set.run().out, imu)) << set.run().out;
  const Replay configured({"--duration", "1", "-c", configuration("dds: {frame_base: mast}\n"), bag});
  EXPECT_TRUE(contains(configured.run().out, lidar)) << configured.run().out;
  EXPECT_TRUE(contains(configured.run().out, imu)) << configured.run().out;
}

TEST_F(Mountings, FileSetsTheMountingsThatItNames) {
  const std::string bag = bag_with({{"base_link", "velodyne", kTurnedMast}, {"base_link", "imu_link", kTurned}});
  const Replay lidar({"--duration", "1", "-c", configuration("lidars: [{T_base_lidar: {xyz_m: [0, 0, 0]}}]\n"), bag});
  EXPECT_FALSE(contains(lidar.run().out, "the lidar (velodyne)")) << lidar.run().out;
  EXPECT_TRUE(contains(lidar.run().out, "imu (imu_link) is mounted at 0.100")) << lidar.run().out;
  const Replay imu({"--duration", "1", "-c",
                    configuration("motion_sources: [{name: imu, kind: imu, topic: /imu/data, T_base_source: {rpy_deg: "
                                  "[90, 0, 0]}}]\n"),
                    bag});
  EXPECT_TRUE(contains(imu.run().out, "the lidar (velodyne) is mounted at 0.200")) << imu.run().out;
  EXPECT_FALSE(contains(imu.run().out, "imu (imu_link)")) << imu.run().out;
}

/// A tree without the base, such as that of a lidar's driver alone.
TEST_F(Mountings, ImuOfALidarThatIsTheBaseIsMountedOnIt) {
  const Replay replay({bag_with({{"sensor", "velodyne", kTurnedMast}, {"sensor", "imu_link", kTurnedMast * kTurned}})});
  EXPECT_TRUE(contains(output_of(replay),
                       "has no mounting of the lidar (velodyne) on base_link, so poses are those of the lidar"));
  EXPECT_TRUE(contains(replay.run().out,
                       "imu (imu_link) is mounted at 0.100 0.000 0.050 m, 90.0 0.0 0.0 deg on velodyne, "
                       "by /tf_static\n"))
      << replay.run().out;
  const Replay set({"--duration", "1", "--set", "lidars.0.T_base_lidar={xyz_m: [0, 0, 1], rpy_deg: [0, 0, 90]}",
                    bag_with({{"sensor", "velodyne", kTurnedMast}, {"sensor", "imu_link", kTurnedMast * kTurned}})});
  EXPECT_TRUE(
      contains(set.run().out, "imu (imu_link) is mounted at 0.000 0.100 1.050 m, 90.0 0.0 90.0 deg on base_link"))
      << set.run().out;
}

tools::StaticTransforms transforms_of(const std::vector<std::tuple<std::string, std::string, Pose>>& all) {
  tools::StaticTransforms transforms;
  for (const auto& [parent, child, T_parent_child] : all)
    transforms.add({transform_message(parent, child, T_parent_child, RosVersion::ros1), Serialisation::ros1});
  return transforms;
}

TEST(StaticTransforms, ConnectFramesThroughCommonAncestors) {
  const Pose T{from_rpy_rad({0, 0, 0.5}), {0.2, 0, 0.6}}, U{from_rpy_rad({0, 0.1, 0}), {0, 0, 0.1}};
  const auto tree = transforms_of({{"base_link", "mast", T}, {"mast", "lidar", U}, {"mast", "imu", T}});
  const auto expect_pose = [](const std::optional<Pose>& found, const Pose& expected) {
    ASSERT_TRUE(found);
    EXPECT_LT((found->translation - expected.translation).norm(), 1e-9);
    EXPECT_LT(found->rotation.angularDistance(expected.rotation), 1e-7);
  };
  expect_pose(tree.between("base_link", "/lidar"), T * U);
  expect_pose(tree.between("lidar", "base_link"), (T * U).inverse());
  expect_pose(tree.between("imu", "lidar"), T.inverse() * U);
  expect_pose(tree.between("alone", "alone"), Pose{});
  EXPECT_FALSE(tree.between("base_link", "camera"));

  const auto circle = transforms_of(
      {{"base_link", "base_footprint", T}, {"base_footprint", "base_link", T.inverse()}, {"base_link", "lidar", U}});
  expect_pose(circle.between("base_link", "base_footprint"), T);
  expect_pose(circle.between("base_footprint", "base_link"), T.inverse());
  expect_pose(circle.between("base_link", "lidar"), U);
  expect_pose(circle.between("base_footprint", "lidar"), T.inverse() * U);
  EXPECT_FALSE(circle.between("camera", "lidar"));
}

TEST(StaticTransforms, AbsurdNamesAreRejected) {
  const std::string name(5000, 'x');
  EXPECT_FALSE(transforms_of({{name, "lidar", Pose{}}}).between(name, "lidar"));
}

} // namespace
} // namespace locus::test
