// SPDX-License-Identifier: Apache-2.0
// Drives on wheels whose lidar is mounted otherwise than configured: reported while driving, and found by --calibrate.
#include <cmath>
#include <cstddef>
#include <string>
#include <utility>
#include <vector>

#include <gtest/gtest.h>
#include <yaml-cpp/yaml.h>

#include "simulated_drive.hpp"

namespace locus::test {
namespace {

using nlohmann::json;

/// Half a minute, as long as an error may remain unreported. The simulator mounts sensors with errors of half a degree.
const SimulatedDrive& wheeled_drive() {
  static const SimulatedDrive drive("urban", "husky", 30, {"--odometry-late-ms", "0"}, 7741, "real");
  return drive;
}

const std::vector<std::string> kPitchedByFourDegrees{"--set", "lidars.0.T_base_lidar.rpy_deg=[0,4,0]"};

YAML::Node entry(const YAML::Node& entries, const std::string& name) {
  for (const YAML::Node& one : entries)
    if (one["name"].as<std::string>() == name)
      return one;
  return YAML::Node{};
}

TEST(WrongLidarMounting, SoundDriveRaisesNoWarning) {
  const Replay replay = wheeled_drive().replay();
  EXPECT_EQ(replay.run().err, "");
  const json learned = replay.summary()["lidars"]["top"]["learned"]["mounting_deg"];
  for (std::size_t axis = 0; axis < 2; ++axis)
    EXPECT_LT(std::abs(learned["value"][axis].get<double>()), 1.0) << learned;
}

/// Without the warning the robot silently climbs or sinks by 70 mm in each metre.
TEST(WrongLidarMounting, TiltIsReportedWithinHalfAMinute) {
  for (const auto& [rpy_deg, words] : std::vector<std::pair<std::string, std::string>>{
           {"[0,4,0]", "about y (pitch)"}, {"[-4,0,0]", "about x (roll)"}}) {
    const Replay replay = wheeled_drive().replay({"--set", "lidars.0.T_base_lidar.rpy_deg=" + rpy_deg});
    EXPECT_NE(replay.run().err.find("lidar top is rotated by"), std::string::npos) << replay.run().err;
    EXPECT_NE(replay.run().err.find(words), std::string::npos) << replay.run().err;
    EXPECT_EQ(replay.run().err.find("motion source imu is rotated"), std::string::npos) << "it is not the IMU";
    EXPECT_NE(replay.summary().value("mounting_warning", "").find(words), std::string::npos);
  }
}

TEST(WrongLidarMounting, TiltIsCalibratedFromARecording) {
  const TemporaryFolder folder;
  const auto rpy_deg = [&](std::vector<std::string> arguments) {
    arguments.insert(arguments.end(), {"--calibrate", folder / "found.yaml"});
    const Replay replay = wheeled_drive().replay(arguments);
    EXPECT_EQ(replay.run().status, 0) << replay.run().err;
    EXPECT_EQ(replay.run().err.find("is rotated"), std::string::npos) << replay.run().err;
    return entry(YAML::LoadFile(folder / "found.yaml")["lidars"], "top")["T_base_lidar"];
  };
  const YAML::Node sound = rpy_deg({}), tilted = rpy_deg(kPitchedByFourDegrees);
  const double sound_deg = sound ? sound["rpy_deg"][1].as<double>() : 0.0;
  ASSERT_TRUE(tilted);
  EXPECT_NEAR(tilted["rpy_deg"][1].as<double>(), sound_deg, 0.5);
  EXPECT_EQ(tilted["xyz_m"][2].as<double>(), 0.8) << "the position is as configured";
}

} // namespace
} // namespace locus::test
