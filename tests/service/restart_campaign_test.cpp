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
#include <vector>

#include <fmt/format.h>

#include "daemon/service/saved_state.hpp"
#include "service/robot_network.hpp"
#include "support/led_clock.hpp"

namespace locus::test {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

/// From the begin of an outage to the interruption, so short that the service does not notice the loss; from its start
/// to the end of the outage.
constexpr Duration kAtOnce = milliseconds{1}, kReady = milliseconds{50};

enum class Interruption { crash, reload, stall };
constexpr std::array<std::string_view, 3> kInterruptions{"crash", "reload", "stall"};

/// Interruption of the service, in time since the start of the drive. Its inputs are lost meanwhile; those of DDS a
/// moment longer, until its peers have found it again.
struct Event {
  Interruption what{};
  Duration begin, lidar_back, sources_back;
  std::string beginning{};        ///< of the service afterwards
  std::vector<std::string> log{}; ///< of the service afterwards

  [[nodiscard]] Duration judged() const { return sources_back + seconds{1}; }
};

/// Schedules crashes (restart after RestartSec= and the start of the program), reloads, and stalls of five seconds that
/// the watchdog ends, 4 : 1 : 1, while the robot drives.
std::vector<Event> schedule(int count, std::uint32_t seed) {
  constexpr std::array kOfSix{Interruption::crash, Interruption::reload, Interruption::crash,
                              Interruption::crash, Interruption::stall,  Interruption::crash};
  constexpr std::array<Duration, 3> kLasts{milliseconds{800}, milliseconds{200}, milliseconds{5800}};
  constexpr Duration kDiscovery = milliseconds{300};
  std::mt19937 random(seed);
  std::vector<Event> events;
  Duration at = seconds{8};
  for (int i = 0; i < count; ++i) {
    const Interruption what = kOfSix[static_cast<std::size_t>(i) % kOfSix.size()];
    at += milliseconds{3000 + random() % 3000};
    const Duration back = at + kLasts[static_cast<std::size_t>(what)];
    events.push_back({what, at, back, back + kDiscovery});
    at = events.back().judged();
  }
  return events;
}

/// Interrupts the service in mid-drive of a robot with realistic imperfections (slipping wheels, people, cars), on a
/// clock that the player moves, so that no input is late, however busy the computer is. By hand, RESTARTS is the number
/// of interruptions, some eight seconds each; SEED selects drive and times. Results: decision 30.
class RestartCampaign : public RobotNetwork, public testing::WithParamInterface<const char*> {
 protected:
  static int number(const char* variable, int otherwise) {
    const char* const text = std::getenv(variable); // NOLINT(concurrency-mt-unsafe): nobody sets any
    return text != nullptr ? std::atoi(text) : otherwise;
  }

  void SetUp() override {
    if (GetParam() == std::string_view{"corridor"} && number("RESTARTS", 0) == 0)
      GTEST_SKIP() << "known not to hold there, decision 30; by hand with RESTARTS=12";
    RobotNetwork::SetUp();
    if (IsSkipped() || HasFatalFailure())
      return;
    const int seed = number("SEED", 4711);
    events_ = schedule(number("RESTARTS", 12), static_cast<std::uint32_t>(seed));
    const auto lasts = std::chrono::ceil<seconds>(events_.back().judged()) + seconds{5};
    const ProgramRun sim =
        run_program(LOCUS_SIM, {"--world", GetParam(), "--robot", "husky", "--duration", std::to_string(lasts.count()),
                                "--seed", std::to_string(seed), "-o", drive().string()});
    ASSERT_EQ(sim.status, 0) << sim.err;
  }

  [[nodiscard]] std::filesystem::path drive() const { return file("drive"); }

  [[nodiscard]] std::vector<std::string> play_options() const {
    std::vector<std::string> options{drive().string()};
    for (const Event& event : events_)
      for (const char* const sensor : {"all-lidars", "wio", "imu"}) {
        const Duration back = sensor == std::string_view{"all-lidars"} ? event.lidar_back : event.sources_back;
        options.insert(options.end(),
                       {"--fail", fmt::format("{}:lost@{}-{}", sensor, to_seconds(event.begin), to_seconds(back))});
      }
    return options;
  }

  void wait_for_sources() {
    status_when([](const nlohmann::json& now) {
      return std::ranges::all_of(now["sources"], [](const auto& source) { return source["writers"] == 1; });
    });
    ASSERT_FALSE(HasNonfatalFailure()) << testing::PrintToString(daemon_->lines());
  }

  /// Waits until the disk has the pose of the last sweep: the disk's time is not that of the player.
  [[nodiscard]] bool pose_is_saved(const Event& event) {
    constexpr Duration kNewest = milliseconds{200};
    const Stamp last{Duration{led_time().wall_ns} + event.begin - kNewest};
    return comes_true([&] {
      const auto state = daemon::load_state(file("state"));
      return state && state->last.stamp >= last;
    });
  }

  /// Interrupts the service where the player holds the time, just after the begin of the event.
  void interrupt(const Event& event, const std::vector<std::string>& service) {
    LedTime& time = led_time();
    ASSERT_TRUE(pose_is_saved(event));
    if (event.what == Interruption::reload) {
      ASSERT_EQ(ctl({"reload"}).status, 0);
    } else {
      daemon_->signal(SIGKILL);
      ASSERT_TRUE(daemon_->wait_for_exit());
    }
    time.hold_at_ns = (event.lidar_back - kReady).count();
    ASSERT_TRUE(is_held());
    if (event.what != Interruption::reload) {
      daemon_.emplace(service);
      ASSERT_TRUE(daemon_->wait_for_line("DDS is up")) << testing::PrintToString(daemon_->lines());
    }
    wait_for_sources();
  }

  /// Drives with all interruptions.
  void run() {
    const std::vector<std::string> service = led_locusd(drive() / "config.yaml");
    LedTime& time = led_time();
    daemon_.emplace(service);
    listener_.emplace(std::vector<std::string>{CYCLONE_PEER, "0", "listen", "/locus"});
    ASSERT_TRUE(hears_the_service(*listener_));
    time.hold_at_ns = (events_.front().begin + kAtOnce).count();
    play_.emplace(leading_play(play_options()));
    for (auto event = events_.begin(); event != events_.end(); ++event) {
      ASSERT_TRUE(is_held());
      ASSERT_NO_FATAL_FAILURE(interrupt(*event, service));
      time.hold_at_ns = event->judged().count();
      ASSERT_TRUE(is_held());
      ASSERT_TRUE(status_comes([&](const nlohmann::json& now) {
        event->beginning = now.contains("beginning") && now["beginning"].is_string() ? now["beginning"] : "";
        return !event->beginning.empty();
      }));
      event->log = daemon_->lines();
      time.hold_at_ns = std::next(event) != events_.end() ? (std::next(event)->begin + kAtOnce).count() : 0;
    }
    ASSERT_EQ(play_->wait_for_exit(seconds{200}), 0) << testing::PrintToString(play_->lines());
  }

  /// Error of the estimated motion across an event, and the true distance.
  struct Step {
    double error_m, way_m;
    [[nodiscard]] bool holds() const { return error_m < 0.05 + 0.02 * way_m; }
  };
  [[nodiscard]] static Step step(const std::vector<StampedPose>& poses, const std::vector<StampedPose>& truth,
                                 Stamp began, Stamp judged) {
    const auto after = std::ranges::lower_bound(poses, judged, {}, &StampedPose::stamp);
    const auto first_lost = std::ranges::lower_bound(poses, began, {}, &StampedPose::stamp);
    if (first_lost == poses.begin() || after == poses.end())
      return {1e9, 0};
    const StampedPose& before = *std::prev(first_lost);
    const auto true_pose = [&](Stamp stamp) {
      return std::ranges::lower_bound(truth, stamp, {}, &StampedPose::stamp)->T_source_base;
    };
    const Pose told = before.T_source_base.inverse() * after->T_source_base;
    const Pose truly = true_pose(before.stamp).inverse() * true_pose(after->stamp);
    double way_m = 0;
    for (Stamp s = before.stamp; s < after->stamp; s += milliseconds{100})
      way_m += (true_pose(s + milliseconds{100}).translation - true_pose(s).translation).norm();
    return {(told.translation - truly.translation).norm(), way_m};
  }

  /// Returns the received poses in the time of the recording.
  [[nodiscard]] std::vector<StampedPose> poses() const {
    std::vector<StampedPose> all;
    const Duration shift = shift_of(*play_);
    for (const HeardPose& pose : heard(*listener_))
      all.push_back({pose.stamp - shift, pose.T_odom_base});
    return all;
  }

  std::vector<Event> events_;
  std::optional<Child> daemon_, listener_, play_;
};

/// Expects no jump by a metre without an announcement, and by hand that 98 of 100 resume within 50 mm and 2 % of the
/// distance. The same intervals of the replay show how many are within that without a restart.
TEST_P(RestartCampaign, ResumesAtTheTruePose) {
  ASSERT_NO_FATAL_FAILURE(run());
  const std::vector<StampedPose> truth = read_tum(drive() / "gt.tum");
  const std::vector<StampedPose> received = poses();
  const std::vector<StampedPose> uninterrupted = Replay({"--quiet", drive().string()}).trajectory();
  int resumed = 0, held = 0, elsewhere = 0;
  for (const Event& event : events_) {
    const Stamp start = truth.front().stamp;
    const Step moved = step(received, truth, start + event.begin, start + event.judged());
    const Step replayed = step(uninterrupted, truth, start + event.begin, start + event.judged());
    resumed += moved.holds() ? 1 : 0;
    held += replayed.holds() ? 1 : 0;
    elsewhere += event.beginning == "map" ? 0 : 1;
    fmt::print("{} {} at {:.1f} s: from {}, {:.0f} mm off after {:.2f} m, without it {:.0f} mm{}\n", GetParam(),
               kInterruptions[static_cast<std::size_t>(event.what)], to_seconds(event.begin), event.beginning,
               1e3 * moved.error_m, moved.way_m, 1e3 * replayed.error_m, moved.holds() ? "" : " <--");
    if (!moved.holds())
      fmt::print("  {}\n", fmt::join(event.log, "\n  "));
    EXPECT_TRUE(event.beginning == "origin" || moved.error_m < 1.0) << "the frame jumped unannounced";
  }
  fmt::print("{}: {} of {} resumed; without an interruption {} of the same intervals\n", GetParam(), resumed,
             events_.size(), held);
  EXPECT_EQ(std::ranges::count_if(listener_->lines(),
                                  [](const std::string& line) { return line.starts_with("beginning 1 "); }),
            elsewhere);
  if (number("RESTARTS", 0) > 0) {
    EXPECT_GE(resumed, 0.98 * static_cast<double>(events_.size())) << "not reached yet, decision 30";
  }
}

INSTANTIATE_TEST_SUITE_P(InA, RestartCampaign, testing::Values("urban", "tunnel", "corridor"),
                         [](const auto& world) { return std::string{world.param}; });

} // namespace
} // namespace locus::test
