// SPDX-License-Identifier: Apache-2.0
// Drives with a lidar that is wrong: wheels and gyro know better, and carry.
#include <string>
#include <vector>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "simulated_drive.hpp"

namespace locus::test {
namespace {

using nlohmann::json;

TEST(WrongLidar, ThatMeasuresTooFarNowAndThenIsOutvoted) {
  const SimulatedDrive drive("tunnel", "husky", 60);
  std::vector<std::string> jumps;
  for (int at_s = 20; at_s < 50; at_s += 5) {
    jumps.emplace_back("--fail");
    jumps.push_back(fmt::format("top:jump=2@{}-{}", at_s, at_s + 1));
  }
  const Replay replay = drive.replay(jumps);
  const json summary = replay.summary();
  EXPECT_GE(summary["sweeps"]["failed"], 20) << "what is not believed is said";
  EXPECT_LE(summary["sweeps"]["failed"], 66) << "six seconds, and a sweep before and after each";
  EXPECT_EQ(summary["sources"]["wio"]["health_changes"], 0);
  EXPECT_LT(ape_mean_m(replay), 0.02);
  EXPECT_LT(summary["ape_m"]["max"], 0.2);
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
