// SPDX-License-Identifier: Apache-2.0
// Wheels that slip while lidar observes the motion.
#include <gtest/gtest.h>

#include "simulated_drive.hpp"

namespace locus::test {
namespace {

/// The robot drives off from a stand at 33.5 s, and its wheels report half as much again for two seconds. No single
/// sweep excludes that they are right; without a rival that is carried over sweeps the path is up to 0.2 m off.
TEST(Slip, OfTheWheelsIsDetectedOverSeveralSweeps) {
  const SimulatedDrive drive("urban", "husky", 36, {}, 9401, "real");
  const Replay replay = drive.replay({"--fail", "imu:lost@0"});
  ASSERT_EQ(replay.run().status, 0) << replay.run().err;
  EXPECT_LT(replay.summary()["ape_m"]["max"].get<double>(), 0.1);
}

} // namespace
} // namespace locus::test
