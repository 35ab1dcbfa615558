// SPDX-License-Identifier: Apache-2.0
// Wheels that report a standstill, whatever the robot does.
#include <gtest/gtest.h>

#include "simulated_drive.hpp"

namespace locus::test {
namespace {

/// The robot stands for two seconds and drives off along a tunnel, where a single sweep observes the forward motion
/// poorly. The wheels repeat their first pose throughout. With wheels that are believed the robot seems to stand.
TEST(StuckWheels, DoNotHoldARobotThatDrivesOff) {
  const SimulatedDrive drive("tunnel", "husky", 14, {}, 9801, "real");
  const Replay replay = drive.replay({"--fail", "imu:lost@0", "--fail", "wio:frozen@0"});
  ASSERT_EQ(replay.run().status, 0) << replay.run().err;
  EXPECT_LT(replay.summary()["ape_m"]["max"].get<double>(), 0.1);
}

} // namespace
} // namespace locus::test
