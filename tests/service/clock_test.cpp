// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <chrono>
#include <csignal>
#include <fstream>
#include <thread>

#include "service/robot_network.hpp"
#include "service/undisturbed.hpp"

namespace locus::test {
namespace {

using std::chrono::hours;
using std::chrono::milliseconds;
using std::chrono::seconds;

/// The clock of the service, and of nobody else, is set while the robot drives.
class HostClock : public RobotNetwork {
 protected:
  void set(Duration offset) {
    const std::int64_t ns = offset.count();
    std::fstream{file("clock"), std::ios::in | std::ios::out | std::ios::binary}.write(
        reinterpret_cast<const char*>(&ns), sizeof(ns)); // NOLINT(bugprone-narrowing-conversions)
  }

  /// Whether both peers go on hearing estimates.
  static bool is_heard(const Child& cyclone, const Child& fast_dds) {
    const auto hears = [](const Child& peer) {
      const auto estimates = [](const std::vector<std::string>& lines) {
        return std::ranges::count_if(lines, [](const std::string& line) { return line.starts_with("odometry "); });
      };
      const auto before = estimates(peer.lines());
      return peer.wait_until(seconds{2}, [&](const auto& lines) { return estimates(lines) > before + 10; });
    };
    return hears(cyclone) && hears(fast_dds);
  }
};

TEST_F(HostClock, ThatIsSetBackForwardAndToAndFroLeavesEveryListenerItsOdometry) {
  std::ofstream{file("clock"), std::ios::binary} << std::string(sizeof(std::int64_t), '\0');
  const std::filesystem::path drive = plant();
  std::vector<std::string> command{"/usr/bin/env", std::string{"LD_PRELOAD="} + STEPPED_CLOCK_LIBRARY,
                                   "STEPPED_CLOCK=" + file("clock").string()};
  for (const std::string& word : locusd(drive / "config.yaml"))
    command.push_back(word);
  Child daemon(undisturbed(command));
  const Child cyclone(undisturbed({CYCLONE_PEER, "0", "listen", "/locus"}));
  const Child fast_dds(undisturbed({FAST_DDS_PEER, "0", "listen", "/locus"}));
  ASSERT_TRUE(daemon.wait_for_line("DDS is up", seconds{10}));
  Child play(undisturbed({LOCUS_PLAY, drive.string()}));
  ASSERT_TRUE(is_heard(cyclone, fast_dds));
  for (const Duration offset : {Duration{-hours{1}}, Duration{hours{1}}, Duration{milliseconds{-700}}, Duration{}}) {
    set(offset);
    std::this_thread::sleep_for(seconds{1});
    EXPECT_TRUE(is_heard(cyclone, fast_dds)) << to_seconds(offset) << " s off";
    const nlohmann::json status = this->status();
    EXPECT_EQ(status["packets"]["total"]["lost"], 0) << to_seconds(offset) << " s off";
  }
  ASSERT_EQ(play.wait_for_exit(seconds{60}), 0);
  const Replay replay({"--quiet", drive.string()});
  const Pose there = replay.trajectory().back().T_source_base;
  for (const Child* peer : {&cyclone, &fast_dds}) {
    const Pose heard_last = heard(*peer).back().T_odom_base;
    EXPECT_LT((heard_last.translation - there.translation).norm(), 0.3);
  }
  daemon.signal(SIGTERM);
  EXPECT_EQ(daemon.wait_for_exit(seconds{1}), 0) << testing::PrintToString(daemon.lines());
}

} // namespace
} // namespace locus::test
