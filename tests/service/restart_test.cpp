// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <chrono>
#include <csignal>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include <fmt/format.h>

#include "service/robot_network.hpp"
#include "support/led_clock.hpp"

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
    EXPECT_TRUE(daemon_->wait_for_line("resumed from the saved state")) << testing::PrintToString(daemon_->lines());
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
TEST_F(Restart, ResumesAtThePoseOfTheRobotAfterStopAndKill) {
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
TEST_F(Restart, ResumesAtThePoseOfTheWheelsAfterASixSecondStall) {
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

/// The same on a clock that the player moves: all that the sensors send while the service is away is lost, and the time
/// stands still while it ends and begins.
class RestartWithHeldInput : public RobotNetwork {
 protected:
  struct Outage {
    int signal;
    Duration begin, end;
  };

  void drive_with(const std::vector<Outage>& outages) {
    const std::vector<std::string> service = led_locusd(plant() / "config.yaml");
    daemon_.emplace(service);
    listener_.emplace(std::vector<std::string>{CYCLONE_PEER, "0", "listen", "/locus"});
    ASSERT_TRUE(hears_the_service(*listener_));
    std::vector<std::string> options{plant().string()};
    for (const Outage& outage : outages)
      for (const char* sensor : {"all-lidars", "wio", "imu"})
        options.insert(options.end(), {"--fail", fmt::format("{}:lost@{}-{}", sensor, to_seconds(outage.begin),
                                                             to_seconds(outage.end))});
    LedTime& time = led_time();
    time.hold_at_ns = (outages.front().begin + kAmid).count();
    play_.emplace(leading_play(options));
    for (std::size_t i = 0; i < outages.size(); ++i) {
      ASSERT_TRUE(is_held());
      daemon_->signal(outages[i].signal);
      ASSERT_TRUE(daemon_->wait_for_exit());
      time.hold_at_ns = (outages[i].end - kAmid).count();
      ASSERT_TRUE(is_held());
      daemon_.emplace(service);
      ASSERT_TRUE(daemon_->wait_for_line("DDS is up"));
      ASSERT_TRUE(status_comes([](const nlohmann::json& now) {
        return std::ranges::all_of(now["sources"], [](const auto& source) { return source["writers"] == 1; });
      }));
      time.hold_at_ns = i + 1 < outages.size() ? (outages[i + 1].begin + kAmid).count() : 0;
      EXPECT_TRUE(daemon_->wait_for_line("resumed from the saved state")) << testing::PrintToString(daemon_->lines());
    }
    ASSERT_EQ(play_->wait_for_exit(patience_of_a_drive()), 0) << testing::PrintToString(play_->lines());
    const Replay replay({"--quiet", plant().string()});
    const double error_m = worst_distance_m(replay.trajectory(), heard(*listener_), shift_of(*play_));
    RecordProperty("worst_um", static_cast<int>(1e6 * error_m));
    EXPECT_LT(error_m, 0.1);
  }

  std::optional<Child> daemon_, listener_, play_;

 private:
  static constexpr Duration kAmid = milliseconds{50}; ///< from the edges of an outage to what happens in it
};

/// The status of DDS was once updated only as the service's time advances. On a busy computer the publishers were
/// discovered after its first update, and a test that held the time waited for them in vain.
TEST_F(RestartWithHeldInput, DiscoversLatePublishersWhileTheTimeStandsStill) {
  const std::vector<std::string> service = led_locusd(plant() / "config.yaml");
  const auto has_writers = [](const nlohmann::json& now, int expected) {
    return std::ranges::all_of(now["sources"], [&](const auto& source) { return source["writers"] == expected; });
  };
  daemon_.emplace(service);
  ASSERT_TRUE(daemon_->wait_for_line("DDS is up")); // the player ends if no service answers
  led_time().hold_at_ns = Duration{seconds{1}}.count();
  play_.emplace(leading_play({plant().string()}));
  ASSERT_TRUE(is_held());
  play_->signal(SIGSTOP);
  daemon_->signal(SIGKILL);
  ASSERT_TRUE(daemon_->wait_for_exit());
  daemon_.emplace(service);
  ASSERT_TRUE(daemon_->wait_for_line("DDS is up"));
  listener_.emplace(std::vector<std::string>{CYCLONE_PEER, "0", "listen", "/locus"});
  ASSERT_TRUE(listener_->wait_for_line("matched odometry"));
  ASSERT_TRUE(has_writers(status(), 0));
  play_->signal(SIGCONT);
  status_when([&](const nlohmann::json& now) { return has_writers(now, 1); });
}

TEST_F(RestartWithHeldInput, ResumesAtThePoseOfTheRobotAfterStopAndKill) {
  drive_with({{SIGTERM, seconds{5}, milliseconds{5500}}, {SIGKILL, seconds{10}, milliseconds{10500}}});
  EXPECT_GT(heard(*listener_).size(), 120U);
}

TEST_F(RestartWithHeldInput, ResumesAtThePoseOfTheWheelsAfterSixSeconds) {
  drive_with({{SIGKILL, seconds{5}, seconds{11}}});
  EXPECT_EQ(status()["beginning"], "map");
  EXPECT_TRUE(listener_->wait_until([](const auto& lines) {
    return std::ranges::count_if(lines, [](const std::string& line) { return line.starts_with("beginning "); }) == 2;
  }));
  EXPECT_EQ(listener_->lines_of("beginning"),
            (std::vector<std::string>{"0 7 locusd: beginning", "0 7 locusd: beginning"}));
}

} // namespace
} // namespace locus::test
