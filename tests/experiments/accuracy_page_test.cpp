// SPDX-License-Identifier: Apache-2.0
// Runs locus-experiments --accuracy on various recordings.
#include <algorithm>
#include <chrono>
#include <cmath>
#include <fstream>

#include <gtest/gtest.h>

#include "locus_experiments/accuracy_figures.hpp"
#include "replay/replay_run.hpp"
#include "support/test_data.hpp"
#include "support/test_drives.hpp"

namespace locus::test {
namespace {

using nlohmann::json;
using namespace std::chrono_literals;

ProgramRun accuracy(std::vector<std::string> arguments) {
  arguments.insert(arguments.begin(), {"--accuracy", "--quiet"});
  return run_program(LOCUS_EXPERIMENTS, arguments);
}

json recordings_in(const std::filesystem::path& folder) {
  return json::parse(read_text(folder / "results.json"))["recordings"];
}

double length_m(const std::vector<StampedPose>& trajectory) {
  double sum_m = 0;
  for (std::size_t i = 1; i < trajectory.size(); ++i)
    sum_m += (trajectory[i].T_source_base.translation - trajectory[i - 1].T_source_base.translation).norm();
  return sum_m;
}

/// Writes one second of a static lidar in the room, as a capture without any other file.
void write_standing_capture(const std::filesystem::path& file, const std::filesystem::path& scratch) {
  sim::RobotOptions robot;
  robot.lidars.front().options.T_base_lidar.translation = {0, 0, 0.75};
  robot.lidars.front().options.range_noise_m = 0.01;
  robot.lidars.front().options.sends_position_packets = true;
  sim::write_capture_folder(scratch, sim::room(), sim::Trajectory(sim::Course{}.stand(1s), sim::room_start()), 1s,
                            robot);
  std::filesystem::rename(scratch / "lidar.pcap", file);
}

TEST(AccuracyPage, ShowsEachRecording) {
  const TemporaryFolder folder;
  std::filesystem::create_directories(folder / "data");
  std::filesystem::copy(room_drive(), folder / "data/robot");
  write_standing_capture(folder / "data/standing.pcap", folder / "scratch");
  std::ofstream{folder / "data/garbage.pcap"} << "no capture at all";
  std::filesystem::copy(kitti_room_drive().parent_path(), folder / "data/kitti",
                        std::filesystem::copy_options::recursive);
  const ProgramRun run = accuracy({folder / "data", "-o", folder / "out"});
  ASSERT_EQ(run.status, 0) << run.err;

  const json recordings = recordings_in(folder / "out");
  ASSERT_EQ(recordings.size(), 4U);
  const json &garbage = recordings[0], &kitti = recordings[1], &robot = recordings[2], &standing = recordings[3];
  EXPECT_EQ(garbage["recording"], "garbage.pcap");
  EXPECT_NE(garbage["runs"][0]["failed"].get<std::string>().find("pcap"), std::string::npos);

  ASSERT_EQ(robot["runs"].size(), 3U);
  EXPECT_EQ(robot["runs"][0]["sources"], (json{"wio", "imu"}));
  EXPECT_EQ(robot["runs"][1]["sources"], json{"imu"});
  EXPECT_EQ(robot["runs"][2]["sources"], json::array());
  for (const json& of_robot : robot["runs"]) {
    EXPECT_NEAR(of_robot["way"]["way_m"].get<double>(), length_m(read_tum(room_drive() / "gt.tum")), 0.3)
        << "except before the first sweep and after the last";
    EXPECT_LT(of_robot["summary"]["ape_m"]["max"].get<double>(), 0.1);
    for (const auto& [name, source] : of_robot["summary"]["sources"].items())
      EXPECT_EQ(source["used_sweeps"] > 0, std::ranges::count(of_robot["sources"], json(name)) > 0) << name;
  }

  ASSERT_EQ(kitti["runs"].size(), 2U) << "it has only an IMU and lidar";
  EXPECT_EQ(kitti["runs"][0]["sources"], json{"imu"});
  for (const json& of_kitti : kitti["runs"]) {
    EXPECT_EQ(of_kitti["summary"]["kitti_vertical_angle_added_deg"], 0.205);
    EXPECT_GT(of_kitti["way"]["way_m"], 0.8) << "compared with its inertial unit";
  }

  ASSERT_EQ(standing["runs"].size(), 1U) << "it has only lidar";
  EXPECT_LT(standing["runs"][0]["claims"]["farthest_m"].get<double>(), 0.02);
  EXPECT_EQ(standing["receiver"]["max_mps"], 0.0);

  const std::string page = read_text(folder / "out/accuracy.md");
  EXPECT_NE(page.find("| robot, VLP-16 | lidar alone |"), std::string::npos) << page;
  EXPECT_NE(page.find("| standing.pcap, VLP-16 | lidar alone |"), std::string::npos) << page;
  EXPECT_NE(page.find("| kitti/2023_11_14_drive_0001_extract | imu | 0.9"), std::string::npos) << page;
  EXPECT_NE(page.find("0.205 degrees are added"), std::string::npos) << page;
  EXPECT_NE(page.find("| garbage.pcap | "), std::string::npos) << page;
  EXPECT_EQ(page.find(folder.path().string()), std::string::npos) << "names only: " << page;
}

TEST(AccuracyPage, WithoutRecordingsListsTheSupportedKinds) {
  const TemporaryFolder folder;
  std::filesystem::create_directories(folder / "empty");
  const ProgramRun run = accuracy({folder / "empty", "-o", folder / "out"});
  EXPECT_EQ(run.status, 1);
  EXPECT_EQ(lines_of(run.err).size(), 1U) << run.err;
  EXPECT_NE(run.err.find("lidar.pcap"), std::string::npos) << run.err;
  EXPECT_EQ(accuracy({folder / "nowhere", "-o", folder / "out"}).status, 1);
}

TEST(AccuracyPage, WithoutAReplayableRecordingFails) {
  const TemporaryFolder folder;
  std::ofstream{folder / "garbage.pcap"} << "no capture at all";
  const ProgramRun run = accuracy({folder.path(), "-o", folder / "out"});
  EXPECT_EQ(run.status, 1);
  EXPECT_EQ(lines_of(run.err).size(), 1U) << run.err;
  EXPECT_NE(run.err.find("no recording could be replayed"), std::string::npos) << run.err;
  EXPECT_NE(read_text(folder / "out/accuracy.md").find("| garbage.pcap | "), std::string::npos);
}

TEST(AccuracyPage, WrongUsageIsExplainedInOneLine) {
  for (const std::vector<std::string>& arguments : {std::vector<std::string>{"--accuracy", "-o", "/tmp/x"},
                                                    {"--accuracy", "--faults", "-o", "/tmp/x"},
                                                    {"--simulated", "-o", "/tmp/x"}}) {
    const ProgramRun run = run_program(LOCUS_EXPERIMENTS, arguments);
    EXPECT_EQ(run.status, 2) << run.err;
    EXPECT_EQ(lines_of(run.err).size(), 1U) << run.err;
  }
}

TEST(AccuracyFigures, ClaimsAreRelativeToTheFirstPose) {
  std::vector<StampedPose> trajectory;
  for (int i = 0; i < 11; ++i) // out and back, one second each way
    trajectory.push_back(
        {stamp_from_ns(0) + i * 200ms, Pose{from_rpy_rad({0, 0, 0.1}), {5.0 - std::abs(i - 5), 3, 0}}});
  const auto claims = experiments::claims_of(trajectory);
  EXPECT_NEAR(claims["farthest_m"].get<double>(), 5, 1e-9);
  EXPECT_NEAR(claims["farthest_at_first_m"].get<double>(), 2, 1e-9) << "after 0.4 s";
  EXPECT_NEAR(claims["most_turned_deg"].get<double>(), 0, 1e-6) << "the initial heading is no turn";
  EXPECT_NEAR(claims["speed_mps"]["median"].get<double>(), 5, 1e-9);
  EXPECT_TRUE(experiments::claims_of({trajectory.front()})["speed_mps"].is_null());
  EXPECT_TRUE(experiments::claims_of({})["speed_mps"].is_null());
}

TEST(AccuracyFigures, WithoutAReceiverHaveNoSpeed) {
  const TemporaryFolder folder;
  EXPECT_TRUE(experiments::receiver_speed(folder / "nowhere").is_null());
  std::ofstream{folder / "garbage.pcap"} << "no capture at all";
  EXPECT_TRUE(experiments::receiver_speed(folder / "garbage.pcap").is_null());
  EXPECT_TRUE(experiments::receiver_speed(kitti_room_drive()).is_null());
}

/// GPRMC sentences of the car: 28.8 to 29.5 knots.
TEST(AccuracyFigures, ReadTheReceiverOfARealCar) {
  const std::filesystem::path capture = test_data() / "velodyne/hdl32e_moving_15mps.pcap";
  if (!std::filesystem::exists(capture))
    GTEST_SKIP() << "no real captures in " << test_data() << "; set LOCUS_TEST_DATA";
  const auto speed = experiments::receiver_speed(capture);
  ASSERT_TRUE(speed.is_object());
  EXPECT_NEAR(speed["min_mps"].get<double>(), 14.8, 0.05);
  EXPECT_NEAR(speed["max_mps"].get<double>(), 15.2, 0.05);
}

} // namespace
} // namespace locus::test
