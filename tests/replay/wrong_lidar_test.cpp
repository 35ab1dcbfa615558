// SPDX-License-Identifier: Apache-2.0
// Drives with a lidar that is wrong, or sees little but what moves: wheels and gyro know better, and carry.
#include <string>
#include <vector>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <gtest/gtest.h>

#include "simulated_drive.hpp"

namespace locus::test {
namespace {

using nlohmann::json;

TEST(WrongLidar, ThatMeasuresTooFarNowAndThenIsOutvoted) {
  const SimulatedDrive drive("tunnel", "husky", 60);
  for (const double from_s : {20.0, 20.03, 20.07}) {
    SCOPED_TRACE(from_s);
    const Replay replay = drive.replay(a_second_in_five("top:jump=2", from_s, 50.0));
    const json summary = replay.summary();
    EXPECT_GE(summary["sweeps"]["failed"], 20) << "what is not believed is said";
    EXPECT_LE(summary["sweeps"]["failed"], 66) << "six seconds, and a sweep before and after each";
    EXPECT_EQ(summary["sources"]["wio"]["health_changes"], 0);
    EXPECT_LT(ape_mean_m(replay), 0.01);
    EXPECT_LT(summary["ape_m"]["max"], 0.1);
  }
}

/// Neither a map that was begun with walls where there are none nor one that was good before must bring down what
/// comes after the fault.
TEST(WrongLidar, ThatMeasuresTooFarAtTheStartBeginsAnew) {
  const SimulatedDrive drive("tunnel", "husky", 60);
  for (const double from_s : {0.0, 1.3, 1.5, 2.0}) {
    SCOPED_TRACE(from_s);
    const Replay replay = drive.replay(a_second_in_five("top:jump=2", from_s, 60.0));
    EXPECT_GE(replay.summary()["sweeps"]["failed"], 60);
    EXPECT_LT(ape_mean_m(replay), 0.04);
  }
}

/// A truck goes by within a metre, at 11 s.
TEST(PassingVehicle, TakesNobodyAlong) {
  const SimulatedDrive drive("tunnel", "husky", 60, {"--model", "HDL-32E"}, 7101, "real");
  for (const std::vector<std::string>& lost : std::vector<std::vector<std::string>>{
           {}, {"--fail", "wio:lost@0"}, {"--fail", "wio:lost@0", "--fail", "imu:lost@0"}}) {
    SCOPED_TRACE(fmt::format("{}", fmt::join(lost, " ")));
    EXPECT_LT(drive.replay(lost).summary()["ape_m"]["max"], 0.1);
  }
}

TEST(WrongLidar, OnlyDustIsBelieved) {
  const SimulatedDrive drive("urban", "husky", 30, {"--dust", "0.1"});
  const Replay replay = drive.replay();
  EXPECT_EQ(replay.summary()["sweeps"]["failed"], 0);
  EXPECT_LT(ape_mean_m(replay), 0.01);
}

/// No lidar to tell what a gyro reads at rest: wheels tell.
TEST(WrongLidar, ThatFreezesAtItsFirstPacketLeavesWheelsAndGyro) {
  const SimulatedDrive drive("urban", "husky", 60);
  const Replay replay = drive.replay({"--fail", "top:frozen@0"});
  EXPECT_EQ(replay.summary()["sweeps"]["failed"], 598);
  EXPECT_LT(ape_mean_m(replay), 0.12);
}

} // namespace
} // namespace locus::test
