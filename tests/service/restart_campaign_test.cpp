// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <optional>
#include <random>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

#include <fmt/format.h>

#include "daemon/machine_time.hpp"
#include "service/robot_network.hpp"

namespace locus::test {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

enum class Interruption { crash, reload, stall };
constexpr std::array<std::string_view, 3> kInterruptions{"crash", "reload", "stall"};

/// Run manually with RESTARTS=36, nine seconds each: interrupts the service this often while its robot drives with
/// realistic imperfections, by crashes, reloads, and stalls that the watchdog ends. SEED selects drive and times.
/// Results: decision 30.
class RestartCampaign : public RobotNetwork, public testing::WithParamInterface<std::string> {
 protected:
  struct Event {
    Interruption what;
    Stamp began, over; ///< host clock, as the stamps of the poses
    std::string beginning;
  };

  static int number(const char* variable, int otherwise) {
    const char* const text = std::getenv(variable); // NOLINT(concurrency-mt-unsafe): nobody sets any
    return text != nullptr ? std::atoi(text) : otherwise;
  }
  static Stamp now() { return Stamp{daemon::read_clock(CLOCK_REALTIME)}; }

  void SetUp() override {
    restarts_ = number("RESTARTS", 0);
    if (restarts_ == 0)
      GTEST_SKIP() << "takes minutes: by hand, with RESTARTS=36";
    RobotNetwork::SetUp();
    if (IsSkipped() || HasFatalFailure())
      return;
    drive_ = seconds{20 + 9 * restarts_};
    const ProgramRun sim =
        run_program(LOCUS_SIM, {"--world", GetParam(), "--robot", "husky", "--duration", std::to_string(drive_.count()),
                                "--seed", std::to_string(number("SEED", 4711)), "-o", file("drive").string()});
    ASSERT_EQ(sim.status, 0) << sim.err;
    start();
    listener_.emplace(std::vector<std::string>{CYCLONE_PEER, "0", "listen", "/locus"});
    ASSERT_TRUE(hears_the_service(*listener_));
    play_.emplace(std::vector<std::string>{LOCUS_PLAY, file("drive").string()});
    ASSERT_TRUE(daemon_->wait_for_line("tracking"));
  }

  void start() { daemon_.emplace(locusd(file("drive") / "config.yaml")); }

  void kill_and_start() {
    daemon_->signal(SIGKILL);
    ASSERT_TRUE(daemon_->wait_for_exit());
    std::this_thread::sleep_for(milliseconds{500}); // as RestartSec=
    start();
    ASSERT_TRUE(daemon_->wait_for_line("DDS is up"));
  }

  Event interrupt(Interruption what) {
    Event event{.what = what, .began = now(), .over = {}, .beginning = {}};
    if (what == Interruption::stall) {
      daemon_->signal(SIGSTOP);
      std::this_thread::sleep_for(seconds{5});
    }
    if (what == Interruption::reload)
      EXPECT_EQ(ctl({"reload"}).status, 0);
    else
      kill_and_start();
    EXPECT_TRUE(status_comes(
        [](const auto& status) { return status.contains("beginning") && status["beginning"].is_string(); }));
    event.over = now() + seconds{1};
    event.beginning = status().value("beginning", "");
    return event;
  }

  /// Error of the estimated motion between two stamps, and the true distance.
  struct Step {
    double error_m, way_m;
  };
  [[nodiscard]] static std::optional<Step>
  step(const std::vector<HeardPose>& poses, const std::vector<StampedPose>& truth, Duration shift, const Event& event) {
    const auto after = std::ranges::lower_bound(poses, event.over, {}, &HeardPose::stamp);
    const auto first_lost = std::ranges::lower_bound(poses, event.began, {}, &HeardPose::stamp);
    if (first_lost == poses.begin() || after == poses.end())
      return std::nullopt;
    const HeardPose& before = *std::prev(first_lost);
    const auto true_pose = [&](Stamp stamp) {
      return *std::ranges::lower_bound(truth, stamp - shift, {}, &StampedPose::stamp);
    };
    const Pose T_before_after = before.T_odom_base.inverse() * after->T_odom_base;
    const Pose truly = true_pose(before.stamp).T_source_base.inverse() * true_pose(after->stamp).T_source_base;
    double way_m = 0;
    for (Stamp s = before.stamp; s < after->stamp; s += milliseconds{100})
      way_m +=
          (true_pose(s + milliseconds{100}).T_source_base.translation - true_pose(s).T_source_base.translation).norm();
    return Step{(T_before_after.translation - truly.translation).norm(), way_m};
  }

  int restarts_ = 0;
  seconds drive_{};
  std::optional<Child> daemon_, listener_, play_;
};

TEST_P(RestartCampaign, ResumesAtTheTruePose) {
  std::mt19937 random(static_cast<std::uint32_t>(number("SEED", 4711)));
  std::vector<Event> events;
  for (int i = 0; i < restarts_; ++i) { // four of six are crashes
    constexpr std::array kOfSix{Interruption::crash, Interruption::reload, Interruption::crash,
                                Interruption::crash, Interruption::stall,  Interruption::crash};
    std::this_thread::sleep_for(milliseconds{2000 + random() % 3000});
    events.push_back(interrupt(kOfSix[static_cast<std::size_t>(i) % kOfSix.size()]));
    ASSERT_FALSE(HasFatalFailure());
  }
  ASSERT_FALSE(play_->wait_for_exit(milliseconds{0})) << "the drive was too short";
  ASSERT_EQ(play_->wait_for_exit(drive_), 0);

  const std::vector<StampedPose> truth = read_tum(file("drive") / "gt.tum");
  const std::vector<HeardPose> poses = heard(*listener_);
  const Duration shift = shift_of(*play_);
  int went_on = 0;
  for (const Event& event : events) {
    const auto moved = step(poses, truth, shift, event);
    ASSERT_TRUE(moved) << "no estimate came after a restart";
    const bool holds = moved->error_m < 0.05 + 0.02 * moved->way_m;
    went_on += holds ? 1 : 0;
    fmt::print("{} {}: from {}, {:.0f} mm off after {:.2f} m{}\n", GetParam(),
               kInterruptions[static_cast<std::size_t>(event.what)], event.beginning, 1e3 * moved->error_m,
               moved->way_m, holds ? "" : " <--");
    EXPECT_TRUE(event.beginning == "origin" || moved->error_m < 1.0) << "the frame jumped, and nobody said so";
  }
  fmt::print("{}: {} of {} went on\n", GetParam(), went_on, events.size());
  EXPECT_GE(went_on, 0.98 * static_cast<double>(events.size()));
}

INSTANTIATE_TEST_SUITE_P(InA, RestartCampaign, testing::Values("urban", "tunnel", "corridor"),
                         [](const auto& world) { return world.param; });

} // namespace
} // namespace locus::test
