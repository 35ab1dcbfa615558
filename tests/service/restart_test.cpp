// SPDX-License-Identifier: Apache-2.0
#include <chrono>
#include <csignal>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "service/robot_network.hpp"

namespace locus::test {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

/// A service whose robot drives through a plant.
class Restart : public RobotNetwork {
 protected:
  void SetUp() override {
    RobotNetwork::SetUp();
    if (IsSkipped() || HasFatalFailure())
      return;
    start();
    listener_.emplace(std::vector<std::string>{CYCLONE_PEER, "0", "listen", "/locus"});
    ASSERT_TRUE(hears_the_service(*listener_));
    play_.emplace(std::vector<std::string>{LOCUS_PLAY, plant().string()});
    ASSERT_TRUE(daemon_->wait_for_line("tracking"));
  }

  void start() { daemon_.emplace(locusd(plant() / "config.yaml")); }

  void expect_to_resume() {
    start();
    EXPECT_TRUE(daemon_->wait_for_line("resumed where the service ended")) << testing::PrintToString(daemon_->lines());
  }

  /// After the drive, compares all poses with its replay.
  void expect_all_poses_true() {
    ASSERT_EQ(play_->wait_for_exit(), 0);
    const Replay replay({"--quiet", plant().string()});
    const double error_m = worst_distance_m(replay.trajectory(), heard(*listener_), shift_of(*play_));
    RecordProperty("worst_um", static_cast<int>(1e6 * error_m));
    EXPECT_LT(error_m, 0.1);
  }

  std::optional<Child> daemon_, listener_, play_;
};

/// After a crash only the pose of the last sweep tells how far the robot has come since the map was saved.
TEST_F(Restart, StoppedAndKilledInMidDriveItGoesOnWhereTheRobotIs) {
  for (const int end : {SIGTERM, SIGKILL}) {
    std::this_thread::sleep_for(seconds{4});
    daemon_->signal(end);
    ASSERT_TRUE(daemon_->wait_for_exit());
    std::this_thread::sleep_for(milliseconds{500}); // as RestartSec=
    expect_to_resume();
  }
  expect_all_poses_true();
  EXPECT_GT(heard(*listener_).size(), 120U);
}

/// Restart by the watchdog: six seconds later the robot is elsewhere, and only its wheels have measured
/// the motion.
TEST_F(Restart, StalledForSixSecondsInMidDriveItGoesOnWhereTheWheelsSay) {
  std::this_thread::sleep_for(seconds{3});
  daemon_->signal(SIGSTOP);
  std::this_thread::sleep_for(seconds{6});
  daemon_->signal(SIGKILL);
  ASSERT_TRUE(daemon_->wait_for_exit());
  expect_to_resume();
  EXPECT_EQ(status()["beginning"], "map");
  expect_all_poses_true();
  EXPECT_EQ(listener_->lines_of("beginning"),
            (std::vector<std::string>{"0 7 locusd: beginning", "0 7 locusd: beginning"}));
}

} // namespace
} // namespace locus::test
