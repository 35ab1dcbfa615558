// SPDX-License-Identifier: Apache-2.0
#include <csignal>

#include "service/robot_network.hpp"

namespace locus::test {
namespace {

class EndToEnd : public RobotNetwork {};

TEST_F(EndToEnd, LiveOdometryEqualsTheReplayForCycloneAndFastDds) {
  const std::filesystem::path capture = plant();
  Child daemon(led_locusd(capture / "config.yaml"));
  Child cyclone({CYCLONE_PEER, "0", "listen", "/locus"});
  Child fast_dds({FAST_DDS_PEER, "0", "listen", "/locus"});
  ASSERT_TRUE(hears_the_service(cyclone) && hears_the_service(fast_dds));
  Child play(leading_play({capture.string()}));
  ASSERT_EQ(play.wait_for_exit(patience_of_a_drive()), 0) << testing::PrintToString(play.lines());
  const nlohmann::json status =
      status_when([](const nlohmann::json& s) { return s["lidars"].front()["heard_ms_ago"] > 300; });
  EXPECT_EQ(status["sweeps"]["dropped"], 0);
  EXPECT_EQ(status["sweeps"]["failed"].get<int>() + status["sweeps"]["processed"].get<int>(), status["sweeps"]["seen"]);
  EXPECT_EQ(status["packets"]["kernel_drops"], 0);
  EXPECT_EQ(status["packets"]["total"]["lost"], 0);
  EXPECT_GT(status["sources"]["wio"]["heard_ms_ago"], 200);
  const Replay replay({"--quiet", capture.string()});
  ASSERT_EQ(replay.run().status, 0) << replay.run().err;
  const std::vector<StampedPose> expected = replay.trajectory();
  EXPECT_GE(expected.size(), 198U);
  expect_each_received(expected, heard(cyclone), shift_of(play), "cyclone");
  expect_each_received(expected, heard(fast_dds), shift_of(play), "fast_dds");
  EXPECT_GT(heard(cyclone, "odometry_fast").size(), 5 * expected.size())
      << "at the rate of the IMU, but for what the listener is too slow for";
  const double fast_m = worst_distance_m(expected, heard(cyclone, "odometry_fast"), shift_of(play));
  EXPECT_LT(fast_m, 0.05) << "between two estimates it lies where they say, but for what registration corrects";
  RecordProperty("fast_worst_um", static_cast<int>(1e6 * fast_m));

  daemon.signal(SIGTERM);
  EXPECT_EQ(daemon.wait_for_exit(), 0) << testing::PrintToString(daemon.lines());
}

} // namespace
} // namespace locus::test
