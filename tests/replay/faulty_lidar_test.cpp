// SPDX-License-Identifier: Apache-2.0
// Drives with a faulty lidar, or one that sees mostly moving objects: wheels and gyro carry the odometry.
#include <string>
#include <vector>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <gtest/gtest.h>

#include "simulated_drive.hpp"

namespace locus::test {
namespace {

using nlohmann::json;

TEST(FaultyLidar, WithOccasionalRangeOffsetsIsExcluded) {
  const SimulatedDrive drive("tunnel", "husky", 60);
  for (const double from_s : {20.0, 20.03, 20.07}) {
    SCOPED_TRACE(from_s);
    const Replay replay = drive.replay(a_second_in_five("top:jump=2", from_s, 50.0));
    const json summary = replay.summary();
    EXPECT_GE(summary["sweeps"]["failed"], 20) << "excluded sweeps are counted";
    EXPECT_LE(summary["sweeps"]["failed"], 66) << "six seconds, and a sweep before and after each";
    EXPECT_EQ(summary["sources"]["wio"]["health_changes"], 0);
    EXPECT_LT(ape_mean_m(replay), 0.01);
    EXPECT_LT(summary["ape_m"]["max"], 0.1);
  }
}

/// A map initialised with false walls, and one that was good before the fault, must both recover after it.
TEST(FaultyLidar, WithRangeOffsetAtTheStartRestarts) {
  const SimulatedDrive drive("tunnel", "husky", 60);
  for (const double from_s : {0.0, 1.3, 1.5, 2.0}) {
    SCOPED_TRACE(from_s);
    const Replay replay = drive.replay(a_second_in_five("top:jump=2", from_s, 60.0));
    EXPECT_GE(replay.summary()["sweeps"]["failed"], 60);
    EXPECT_LT(ape_mean_m(replay), 0.04);
  }
}

/// With less to compare lidar with, it must be rejected by its own points.
TEST(FaultyLidar, WithRangeOffsetsIsExcludedByAnySources) {
  const SimulatedDrive drive("tunnel", "husky", 60);
  for (const std::vector<std::string>& lost :
       std::vector<std::vector<std::string>>{{"wio:lost@0"}, {"imu:lost@0"}, {"wio:lost@0", "imu:lost@0"}}) {
    SCOPED_TRACE(fmt::format("{}", fmt::join(lost, " ")));
    std::vector<std::string> faults = a_second_in_five("top:jump=2", 20.0, 50.0);
    for (const std::string& fault : lost)
      faults.insert(faults.end(), {"--fail", fault});
    const Replay replay = drive.replay(faults);
    EXPECT_GE(replay.summary()["sweeps"]["failed"], 20);
    EXPECT_LE(replay.summary()["sweeps"]["failed"], 66);
    EXPECT_LT(ape_mean_m(replay), 0.05);
  }
}

/// A sweep during which the fault begins is not yet rejected. Were its false walls inserted into the map, they would
/// move with the robot, and later sweeps would fit them.
TEST(FaultyLidar, WithRangeOffsetThatBeginsWithinASweepIsNoWorseThanWheels) {
  struct Course {
    std::string world;
    int seed;
  };
  for (const auto& [world, seed] : {Course{"corridor", 99101}, Course{"urban", 99501}}) {
    SCOPED_TRACE(world);
    const SimulatedDrive drive(world, "husky", 60, {}, seed, "real");
    const double by_wheels_m = ape_mean_m(drive.replay({"--fail", "top:lost@0.5"}));
    EXPECT_LT(ape_mean_m(drive.replay(a_second_in_five("top:jump=2", 8.05, 60.0))), 1.2 * by_wheels_m);
  }
}

/// A truck passes at a distance of less than one metre, at 11 s.
TEST(PassingVehicle, DoesNotDragTheEstimateAlong) {
  const SimulatedDrive drive("tunnel", "husky", 60, {"--model", "HDL-32E"}, 7101, "real");
  for (const std::vector<std::string>& lost : std::vector<std::vector<std::string>>{
           {}, {"--fail", "wio:lost@0"}, {"--fail", "wio:lost@0", "--fail", "imu:lost@0"}}) {
    SCOPED_TRACE(fmt::format("{}", fmt::join(lost, " ")));
    EXPECT_LT(drive.replay(lost).summary()["ape_m"]["max"], 0.1);
  }
}

/// The drive has a rival hypothesis when lidar is lost. Meanwhile the robot walks five metres and turns round.
TEST(FaultyLidar, LostForTwentySecondsContinuesFromTheOdometry) {
  const SimulatedDrive drive("stairs", "spot", 60, {}, 99601, "real");
  const Replay replay = drive.replay({"--fail", "top:lost@20-40", "--fail", "imu:lost@20-40"});
  EXPECT_LT(replay.summary()["ape_m"]["max"], 1.0);
}

TEST(FaultyLidar, DustDoesNotDegradeTheEstimate) {
  const SimulatedDrive drive("urban", "husky", 30, {"--dust", "0.1"});
  const Replay replay = drive.replay();
  EXPECT_EQ(replay.summary()["sweeps"]["failed"], 0);
  EXPECT_LT(ape_mean_m(replay), 0.01);
}

/// No lidar to estimate the gyro bias: wheels do.
TEST(FaultyLidar, FrozenFromItsFirstPacketLeavesWheelsAndGyro) {
  const SimulatedDrive drive("urban", "husky", 60);
  const Replay replay = drive.replay({"--fail", "top:frozen@0"});
  EXPECT_EQ(replay.summary()["sweeps"]["failed"], 598);
  EXPECT_LT(ape_mean_m(replay), 0.12);
}

} // namespace
} // namespace locus::test
