// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <csignal>
#include <sstream>

#include "service/robot_network.hpp"
#include "service/undisturbed.hpp"

namespace locus::test {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

class EndToEnd : public RobotNetwork {
 protected:
  /// A drive of locus-sim, whose lidar is locked to PPS: how late this machine wakes up who plays it is not seen in the
  /// stamps.
  [[nodiscard]] std::filesystem::path plant() const {
    std::filesystem::path folder = file("plant");
    const ProgramRun run = run_program(
        LOCUS_SIM, {"--world", "urban", "--robot", "husky", "--duration", "20", "--seed", "3", "-o", folder.string()});
    EXPECT_EQ(run.status, 0) << run.err;
    return folder;
  }
};

/// By what locus-play moved all stamps.
Duration shift_of(const Child& play) {
  for (const std::string& line : play.lines())
    if (const std::size_t at = line.find("shifted by "); at != std::string::npos)
      return Duration{std::stoll(line.substr(at + 11))};
  ADD_FAILURE() << testing::PrintToString(play.lines());
  return {};
}

/// Every pose of the replay was heard, and is the same to 1 cm and 0.1 degrees. Stamps differ by what the jitter of
/// arrivals does to a clock that is set by them.
void expect_same(const std::vector<StampedPose>& replay, const std::vector<HeardPose>& heard, Duration shift,
                 const std::string& who) {
  double worst_m = 0, worst_deg = 0;
  for (const StampedPose& expected : replay) {
    const auto found = std::ranges::min_element(
        heard, {}, [&](const HeardPose& pose) { return std::chrono::abs(pose.stamp - shift - expected.stamp); });
    ASSERT_NE(found, heard.end());
    ASSERT_LT(std::chrono::abs(found->stamp - shift - expected.stamp), milliseconds{2}) << who << " missed a sweep";
    const Pose error = expected.T_source_base.inverse() * found->T_odom_base;
    worst_m = std::max(worst_m, error.translation.norm());
    worst_deg = std::max(worst_deg, angle_rad(error.rotation) / kRadPerDeg);
  }
  EXPECT_LT(worst_m, 0.01) << who;
  EXPECT_LT(worst_deg, 0.1) << who;
  testing::Test::RecordProperty(who + "_worst_um", static_cast<int>(1e6 * worst_m));
  testing::Test::RecordProperty(who + "_worst_mdeg", static_cast<int>(1e3 * worst_deg));
}

/// Between two estimates the odometry carried forward lies where they say, but for what registration corrects.
void expect_between(const std::vector<HeardPose>& estimates, const std::vector<HeardPose>& fast) {
  double worst_m = 0;
  for (const HeardPose& pose : fast) {
    const auto after = std::ranges::upper_bound(estimates, pose.stamp, {}, &HeardPose::stamp);
    if (after == estimates.begin() || after == estimates.end())
      continue;
    const HeardPose& before = *std::prev(after);
    const double share = to_seconds(pose.stamp - before.stamp) / to_seconds(after->stamp - before.stamp);
    const Pose T_odom_base = interpolate(before.T_odom_base, after->T_odom_base, share);
    worst_m = std::max(worst_m, (T_odom_base.translation - pose.T_odom_base.translation).norm());
  }
  EXPECT_LT(worst_m, 0.05);
  testing::Test::RecordProperty("fast_worst_um", static_cast<int>(1e6 * worst_m));
}

TEST_F(EndToEnd, LiveOdometryIsThatOfTheReplayForCycloneAndForFastDds) {
  const std::filesystem::path capture = plant();
  Child daemon(undisturbed(locusd(capture / "config.yaml")));
  Child cyclone(undisturbed({CYCLONE_PEER, "0", "listen", "/locus"}));
  Child fast_dds(undisturbed({FAST_DDS_PEER, "0", "listen", "/locus"}));
  ASSERT_TRUE(daemon.wait_for_line("DDS is up", seconds{10}));
  std::this_thread::sleep_for(seconds{2}); // the listeners find each other
  Child play(undisturbed({LOCUS_PLAY, capture.string()}));
  ASSERT_EQ(play.wait_for_exit(seconds{60}), 0) << testing::PrintToString(play.lines());
  std::this_thread::sleep_for(milliseconds{500});

  const nlohmann::json status = this->status();
  EXPECT_EQ(status["sweeps"]["dropped"], 0);
  EXPECT_EQ(status["sweeps"]["failed"].get<int>() + status["sweeps"]["processed"].get<int>(), status["sweeps"]["seen"]);
  EXPECT_EQ(status["packets"]["kernel_drops"], 0);
  EXPECT_EQ(status["packets"]["total"]["lost"], 0);
  const Replay replay({"--quiet", capture.string()});
  ASSERT_EQ(replay.run().status, 0) << replay.run().err;
  const std::vector<StampedPose> expected = replay.trajectory();
  EXPECT_GE(expected.size(), 198U);
  expect_same(expected, heard(cyclone), shift_of(play), "cyclone");
  expect_same(expected, heard(fast_dds), shift_of(play), "fast_dds");
  EXPECT_GT(heard(cyclone, "odometry_fast").size(), 15 * expected.size()) << "at the rate of the IMU";
  expect_between(heard(cyclone), heard(cyclone, "odometry_fast"));

  daemon.signal(SIGTERM);
  EXPECT_EQ(daemon.wait_for_exit(seconds{1}), 0) << testing::PrintToString(daemon.lines());
}

} // namespace
} // namespace locus::test
