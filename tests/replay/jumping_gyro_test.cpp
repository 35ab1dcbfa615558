// SPDX-License-Identifier: Apache-2.0
// Drives whose gyro jumps for one second in five, at any time within a sweep.
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "simulated_drive.hpp"

namespace locus::test {
namespace {

using nlohmann::json;

/// Simulated once per test process.
const SimulatedDrive& street() {
  static const SimulatedDrive drive("urban", "husky", 60);
  return drive;
}

/// A precise gyro that suddenly fails, at any time within a sweep, must not win against wheels and surfaces.
TEST(JumpingGyro, IsExcludedByWheels) {
  const SimulatedDrive& drive = street();
  const double without_m = without_imu_m(drive);
  const std::vector<std::pair<double, double>> jumps{{0.3, 8.0}, {0.7, 8.0},  {1.0, 8.02},
                                                     {2.0, 8.0}, {2.0, 8.05}, {5.0, 8.08}};
  for (const auto& [by_radps, from_s] : jumps) {
    SCOPED_TRACE(fmt::format("{} rad/s from {} s on", by_radps, from_s));
    const Replay replay = drive.replay(a_second_in_five(fmt::format("imu:jump={}", by_radps), from_s, 60.0));
    const json summary = replay.summary();
    EXPECT_GE(summary["sources"]["imu"]["rejected"]["self_check"], 1);
    EXPECT_EQ(summary["sources"]["wio"]["health_changes"], 0);
    EXPECT_EQ(summary["sweeps"]["failed"], 0);
    EXPECT_LT(ape_mean_m(replay), 1.2 * without_m);
    EXPECT_LT(summary["ape_m"]["max"], 0.05);
  }
}

TEST(JumpingGyro, OnLegsIsExcluded) {
  const SimulatedDrive drive("urban", "spot", 40);
  const double without_m = without_imu_m(drive);
  for (const double by_radps : {0.3, 0.4, 2.0}) {
    SCOPED_TRACE(by_radps);
    const Replay replay = drive.replay(a_second_in_five(fmt::format("imu:jump={}", by_radps), 8.0, 40.0));
    EXPECT_LT(ape_mean_m(replay), 1.2 * without_m + 0.002);
    EXPECT_LT(replay.summary()["ape_m"]["max"], 0.05);
  }
}

/// Legs and camera measure the rotation, too; the first sweep of a jump turns the pose out of reach of what grows here.
TEST(JumpingGyro, OnLegsInAFieldIsExcluded) {
  const SimulatedDrive drive("field", "spot", 30, {}, 2);
  const Replay replay = drive.replay(a_second_in_five("imu:jump=1", 8.0, 30.0));
  EXPECT_EQ(replay.summary()["sweeps"]["failed"], 0);
  EXPECT_LT(ape_mean_m(replay), 0.02);
}

/// Without lidar, legs and camera outvote the gyro.
TEST(JumpingGyro, OnLegsWithoutLidarIsOutvoted) {
  const SimulatedDrive drive("tunnel", "spot", 30, {}, 3, "real");
  std::vector<std::string> faults{"--fail", "top:lost@10-25"};
  const double sound_m = ape_mean_m(drive.replay(faults));
  faults.emplace_back("--fail");
  for (const char* jump : {"imu:jump=2@15-16", "imu:jump=-2@18.05-19"}) {
    faults.emplace_back(jump);
    EXPECT_LT(ape_mean_m(drive.replay(faults)), 1.2 * sound_m) << jump;
    faults.pop_back();
  }
}

TEST(JumpingGyro, WithoutWheelsIsExcluded) {
  const SimulatedDrive& drive = street();
  for (const double from_s : {8.0, 8.05}) {
    SCOPED_TRACE(from_s);
    std::vector<std::string> faults = a_second_in_five("imu:jump=2", from_s, 60.0);
    faults.insert(faults.end(), {"--fail", "wio:lost@0"});
    const Replay replay = drive.replay(faults);
    EXPECT_EQ(replay.summary()["sweeps"]["failed"], 0);
    EXPECT_LT(ape_mean_m(replay), 0.03);
  }
}

/// The first two sweeps are registered again without the gyro.
TEST(JumpingGyro, InAStartingTurnDoesNotDistortTheMap) {
  const SimulatedDrive drive("tunnel", "husky", 60);
  for (const std::string start_s : {"21", "24", "42"}) {
    SCOPED_TRACE(start_s);
    const Replay replay =
        drive.replay({"--start", start_s, "--duration", "15", "--fail", "wio:lost@0", "--fail", "imu:jump=5@0"});
    EXPECT_LT(ape_mean_m(replay), 0.05);
  }
}

} // namespace
} // namespace locus::test
