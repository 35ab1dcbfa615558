// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <chrono>
#include <csignal>
#include <fstream>
#include <thread>

#include "service/notify_socket.hpp"
#include "service/robot_network.hpp"
#include "support/led_clock.hpp"
#include "support/simulated_clock.hpp"

namespace locus::test {
namespace {

using std::chrono::hours;
using std::chrono::milliseconds;
using std::chrono::seconds;

/// Steps the clock of the service alone while the robot drives.
class HostClock : public RobotNetwork {
 protected:
  void set(Duration offset) {
    const std::int64_t ns = offset.count();
    std::fstream{file("clock"), std::ios::in | std::ios::out | std::ios::binary}.write(
        reinterpret_cast<const char*>(&ns), sizeof(ns)); // NOLINT(bugprone-narrowing-conversions)
  }

  /// Returns the command of a service with this clock.
  [[nodiscard]] std::vector<std::string> locusd_with_clock(const std::filesystem::path& config) const {
    std::ofstream{file("clock"), std::ios::binary} << std::string(sizeof(SimulatedTime), '\0');
    std::vector<std::string> command = locusd(config);
    command.insert(command.begin(), {"/usr/bin/env", std::string{"LD_PRELOAD="} + SIMULATED_CLOCK_LIBRARY,
                                     "SIMULATED_CLOCK=" + file("clock").string()});
    return command;
  }

  /// Expects that nothing of the drive was lost, and that the robot came to where the replay has it.
  void expect_nothing_lost(const std::filesystem::path& drive, const Child& listener) const {
    EXPECT_EQ(status()["packets"]["total"]["lost"], 0);
    const Replay replay({"--quiet", drive.string()});
    const Pose there = replay.trajectory().back().T_source_base;
    const Pose heard_last = heard(listener).back().T_odom_base;
    EXPECT_LT((heard_last.translation - there.translation).norm(), 0.05);
  }

  /// Returns whether both peers continue to receive estimates.
  static bool is_heard(const Child& cyclone, const Child& fast_dds) {
    const auto estimates = [](const std::vector<std::string>& lines) {
      return std::ranges::count_if(lines, [](const std::string& line) { return line.starts_with("odometry "); });
    };
    const auto hears_after = [&](const Child& peer, auto before) {
      return peer.wait_until([&](const auto& lines) { return estimates(lines) > before + 10; });
    };
    const auto of_cyclone = estimates(cyclone.lines()), of_fast_dds = estimates(fast_dds.lines());
    return hears_after(cyclone, of_cyclone) && hears_after(fast_dds, of_fast_dds);
  }
};

TEST_F(HostClock, StepsInterruptNoSubscriber) {
  const std::filesystem::path drive = plant();
  Child daemon(locusd_with_clock(drive / "config.yaml"));
  const Child cyclone({CYCLONE_PEER, "0", "listen", "/locus"});
  const Child fast_dds({FAST_DDS_PEER, "0", "listen", "/locus"});
  ASSERT_TRUE(hears_the_service(cyclone) && hears_the_service(fast_dds));
  const Child play(endlessly(drive));
  ASSERT_TRUE(is_heard(cyclone, fast_dds));
  // A participant's lease expires after ten seconds of silence.
  for (const auto& [offset, lasts] : {std::pair{-hours{1}, seconds{12}}, {hours{1}, seconds{1}}}) {
    set(offset);
    std::this_thread::sleep_for(lasts);
    EXPECT_TRUE(is_heard(cyclone, fast_dds)) << offset.count() << " h off";
  }
  EXPECT_TRUE(daemon.wait_for_line("the clock of this computer stepped by -3600.000 s"));
  daemon.signal(SIGTERM);
  EXPECT_EQ(daemon.wait_for_exit(), 0) << testing::PrintToString(daemon.lines());
}

/// Real time: nothing that the sensors sent is missing, and the path equals the replay's.
TEST_F(HostClock, StepsLoseNoPacketAndNoSource) {
  const std::filesystem::path drive = plant();
  Child daemon(locusd_with_clock(drive / "config.yaml"));
  const Child cyclone({CYCLONE_PEER, "0", "listen", "/locus"});
  ASSERT_TRUE(hears_the_service(cyclone));
  Child play({LOCUS_PLAY, drive.string()});
  ASSERT_TRUE(daemon.wait_for_line("tracking"));
  for (const hours offset : {-hours{1}, hours{1}}) {
    std::this_thread::sleep_for(seconds{5});
    set(offset);
  }
  ASSERT_EQ(play.wait_for_exit(), 0);
  status_when([](const auto& s) { return s["lidars"].front()["heard_ms_ago"] > 300; });
  EXPECT_FALSE(daemon.has_line("is lost")) << testing::PrintToString(daemon.lines());
  expect_nothing_lost(drive, cyclone);
}

/// The same on a clock that the player moves.
TEST_F(HostClock, StepsLoseNoInputOfAHeldDrive) {
  const std::filesystem::path drive = plant();
  const Child daemon(led_locusd(drive / "config.yaml"));
  const Child cyclone({CYCLONE_PEER, "0", "listen", "/locus"});
  ASSERT_TRUE(hears_the_service(cyclone));
  LedTime& time = led_time();
  time.hold_at_ns = Duration{seconds{5}}.count();
  Child play(leading_play({drive.string()}));
  for (const auto& [offset, until] : {std::pair{-hours{1}, seconds{10}}, {hours{1}, seconds{19}}}) {
    ASSERT_TRUE(is_held());
    time.set_by_ns = Duration{offset}.count();
    time.hold_at_ns = Duration{until}.count();
  }
  ASSERT_TRUE(is_held());
  EXPECT_TRUE(daemon.wait_for_line("the clock of this computer stepped by +7200.000 s"));
  const nlohmann::json status = this->status();
  for (const auto& [name, source] : status["sources"].items())
    EXPECT_EQ(source["health"], "healthy") << name;
  EXPECT_FALSE(daemon.has_line("is lost")) << testing::PrintToString(daemon.lines());
  time.hold_at_ns = 0;
  ASSERT_EQ(play.wait_for_exit(patience_of_a_drive()), 0) << testing::PrintToString(play.lines());
  status_when([](const auto& s) { return s["lidars"].front()["heard_ms_ago"] > 300; });
  expect_nothing_lost(drive, cyclone);
}

/// No traffic: no message wakes the waiting threads.
TEST_F(HostClock, StepBackWithoutInputLeavesTheWatchdogFed) {
  NotifySocket systemd(file("notify"));
  setenv("WATCHDOG_USEC", "600000", 1); // NOLINT(concurrency-mt-unsafe)
  Child daemon(locusd_with_clock(config()));
  unsetenv("WATCHDOG_USEC"); // NOLINT(concurrency-mt-unsafe)
  ASSERT_TRUE(daemon.wait_for_line("DDS is up"));
  set(-hours{1});
  for (int i = 0; i < 20; ++i)
    EXPECT_TRUE(systemd.hears("WATCHDOG=1")) << i;
}

} // namespace
} // namespace locus::test
