// SPDX-License-Identifier: Apache-2.0
// A lidar in the hands of a person who turns on their heel.
#include <gtest/gtest.h>

#include "simulated_drive.hpp"

namespace locus::test {
namespace {

/// From one sweep to the next the lidar turns at up to 5 rad/s, more than a registration from the former rate reaches,
/// and back half a second later.
TEST(Turn, OnTheHeelIsFollowedByLidarAlone) {
  const SimulatedDrive drive("urban", "handheld", 18, {}, 9962, "real");
  const Replay replay = drive.replay({"--fail", "imu:lost@0"});
  ASSERT_EQ(replay.run().status, 0) << replay.run().err;
  EXPECT_LT(replay.summary()["ape_m"]["max"].get<double>(), 0.2);
}

} // namespace
} // namespace locus::test
