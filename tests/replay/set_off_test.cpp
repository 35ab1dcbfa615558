// SPDX-License-Identifier: Apache-2.0
// A robot with lidar alone that sets off from a stand.
#include <gtest/gtest.h>

#include "simulated_drive.hpp"

namespace locus::test {
namespace {

/// The robot stands for two seconds on rough ground, where hardly any plane is seen, and drives off up a slope. While
/// it stands the map has the points of one sweep only, in the pattern of its scan lines, which moves with the robot.
TEST(SetOff, OnRoughGroundIsFollowedByLidarAlone) {
  const SimulatedDrive drive("field", "husky", 12, {}, 9914, "real");
  const Replay replay = drive.replay({"--fail", "imu:lost@0", "--fail", "wio:lost@0"});
  ASSERT_EQ(replay.run().status, 0) << replay.run().err;
  EXPECT_LT(replay.summary()["ape_m"]["max"].get<double>(), 0.5);
}

} // namespace
} // namespace locus::test
