// SPDX-License-Identifier: Apache-2.0
#include <chrono>
#include <csignal>
#include <memory>
#include <thread>

#include "service/robot_network.hpp"
#include "service/undisturbed.hpp"

namespace locus::test {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

class Restart : public RobotNetwork {};

/// In a plant. After a crash nothing but the whereabouts of the last sweep tells how far it came since the map was
/// saved.
TEST_F(Restart, StoppedAndKilledInMidDriveItGoesOnWhereTheRobotIs) {
  const std::filesystem::path drive = plant(), file = drive / "config.yaml";
  auto daemon = std::make_unique<Child>(undisturbed(locusd(file)));
  Child listener({CYCLONE_PEER, "0", "listen", "/locus"});
  ASSERT_TRUE(daemon->wait_for_line("DDS is up", seconds{10}));
  Child play(undisturbed({LOCUS_PLAY, drive.string()}));
  ASSERT_TRUE(daemon->wait_for_line("tracking", seconds{10}));
  for (const int end : {SIGTERM, SIGKILL}) {
    std::this_thread::sleep_for(seconds{4});
    daemon->signal(end);
    ASSERT_TRUE(daemon->wait_for_exit(seconds{1}));
    std::this_thread::sleep_for(milliseconds{500}); // as RestartSec= has it
    daemon = std::make_unique<Child>(undisturbed(locusd(file)));
    EXPECT_TRUE(daemon->wait_for_line("resumed where the service ended", seconds{5}))
        << testing::PrintToString(daemon->lines());
  }
  ASSERT_EQ(play.wait_for_exit(seconds{30}), 0);

  const Replay replay({"--quiet", drive.string()});
  const std::vector<HeardPose> poses = heard(listener);
  ASSERT_GT(poses.size(), 120U);
  const double error_m = worst_distance_m(replay.trajectory(), poses, shift_of(play));
  RecordProperty("worst_um", static_cast<int>(1e6 * error_m));
  EXPECT_LT(error_m, 0.1);
}

/// As when a watchdog has to end it: five seconds later the robot is elsewhere, and its wheels alone know where.
TEST_F(Restart, StalledForSixSecondsInMidDriveItGoesOnWhereTheWheelsSay) {
  const std::filesystem::path drive = plant(), file = drive / "config.yaml";
  auto daemon = std::make_unique<Child>(undisturbed(locusd(file)));
  Child listener({CYCLONE_PEER, "0", "listen", "/locus"});
  ASSERT_TRUE(daemon->wait_for_line("DDS is up", seconds{10}));
  Child play(undisturbed({LOCUS_PLAY, drive.string()}));
  ASSERT_TRUE(daemon->wait_for_line("tracking", seconds{10}));
  std::this_thread::sleep_for(seconds{3});
  daemon->signal(SIGSTOP);
  std::this_thread::sleep_for(seconds{6});
  daemon->signal(SIGKILL);
  ASSERT_TRUE(daemon->wait_for_exit(seconds{1}));
  daemon = std::make_unique<Child>(undisturbed(locusd(file)));
  EXPECT_TRUE(daemon->wait_for_line("resumed where the service ended", seconds{5}))
      << testing::PrintToString(daemon->lines());
  EXPECT_EQ(status()["beginning"], "map");
  ASSERT_EQ(play.wait_for_exit(seconds{30}), 0);
  EXPECT_EQ(listener.lines_of("beginning"),
            (std::vector<std::string>{"0 7 locusd: beginning", "0 7 locusd: beginning"}));

  const Replay replay({"--quiet", drive.string()});
  const double error_m = worst_distance_m(replay.trajectory(), heard(listener), shift_of(play));
  RecordProperty("worst_um", static_cast<int>(1e6 * error_m));
  EXPECT_LT(error_m, 0.1);
}

} // namespace
} // namespace locus::test
