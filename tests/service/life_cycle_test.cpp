// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <csignal>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include <sys/mount.h>
#include <unistd.h>

#include "config/config_yaml.hpp"
#include "daemon/machine_time.hpp"
#include "daemon/service/saved_state.hpp"
#include "service/notify_socket.hpp"
#include "service/robot_network.hpp"
#include "support/errors.hpp"
#include "support/led_clock.hpp"
#include "support/test_drives.hpp"

namespace locus::test {
namespace {

using nlohmann::json;
using std::chrono::milliseconds;
using std::chrono::seconds;

class LifeCycle : public RobotNetwork {
 protected:
  static void play_to_end(std::vector<std::string> options = {}) {
    options.insert(options.begin(), LOCUS_PLAY);
    options.push_back(capture().string());
    Child play(options);
    EXPECT_EQ(play.wait_for_exit(), 0) << testing::PrintToString(play.lines());
  }
};

TEST_F(LifeCycle, ConfigurationIsCheckedAndPrinted) {
  const ProgramRun printed = run_program(LOCUSD, {"--config", config().string(), "--print-config"});
  EXPECT_EQ(printed.status, 0);
  std::ofstream{file("printed.yaml")} << printed.out;
  EXPECT_EQ(run_program(LOCUSD, {"--config", file("printed.yaml").string(), "--check-config"}).status, 0);
  std::ofstream{file("bad.yaml")} << "dds:\n  domian: 3\n";
  const ProgramRun bad = run_program(LOCUSD, {"--config", file("bad.yaml").string(), "--check-config"});
  EXPECT_EQ(bad.status, 2);
  EXPECT_NE(bad.err.find("bad.yaml:2"), std::string::npos) << bad.err;
}

TEST_F(LifeCycle, UnreadableCalibrationIsAnInvalidConfiguration) {
  for (const char* option : {"--check-config", "--print-config"}) {
    const ProgramRun bad = run_program(LOCUSD, {"--config", lidar_with("calibration: nothere.yaml").string(), option});
    EXPECT_EQ(bad.status, 2) << option;
    EXPECT_EQ(bad.out, "");
    EXPECT_TRUE(contains(bad.err, "lidars.front.calibration: nothere.yaml: cannot be read")) << bad.err;
  }
  EXPECT_EQ(run_program(LOCUSD, {"--config", file("wrong.yaml").string()}).status, 2);
}

/// READY does not wait for sensors, the watchdog is fed without any, and STOPPING is sent.
TEST_F(LifeCycle, SystemdIsNotifiedOfStartReloadStopAndProgress) {
  NotifySocket systemd(file("notify"));
  setenv("WATCHDOG_USEC", "600000", 1); // NOLINT(concurrency-mt-unsafe)
  Child daemon(locusd(config()));
  unsetenv("WATCHDOG_USEC"); // NOLINT(concurrency-mt-unsafe)
  EXPECT_TRUE(systemd.hears("READY=1"));
  EXPECT_TRUE(systemd.hears("WATCHDOG=1"));
  EXPECT_TRUE(systemd.hears("WATCHDOG=1"));
  EXPECT_TRUE(systemd.hears("STATUS=Waiting for the first lidar packet"));
  daemon.signal(SIGHUP);
  EXPECT_TRUE(systemd.hears("RELOADING=1"));
  EXPECT_TRUE(systemd.hears("READY=1"));
  daemon.signal(SIGTERM);
  EXPECT_TRUE(systemd.hears("STOPPING=1"));
  EXPECT_EQ(daemon.wait_for_exit(), 0);
}

TEST_F(LifeCycle, SecondServiceLeavesTheSocketOfTheFirst) {
  const Child first(locusd(config()));
  ASSERT_TRUE(first.wait_for_line("DDS is up"));
  {
    const Child second(locusd(lidar_with("port: 2390")));
    EXPECT_TRUE(second.wait_for_line("control: Address already in use; locusctl will not reach this service, and no "
                                     "incidents are stored: another service"))
        << testing::PrintToString(second.lines());
  }
  EXPECT_EQ(status()["lidars"]["front"]["port"], 2368);
}

TEST_F(LifeCycle, ResetPoseWithoutLidarOutlivesReloadAndRestart) {
  constexpr double kNear_m = 0.5; // the robot stands at the start
  const std::vector<std::string> service = led_locusd(config());
  const auto starts_at_x = [this] {
    const Child listener({CYCLONE_PEER, "0", "listen", "/locus"});
    EXPECT_TRUE(hears_the_service(listener));
    Child play(leading_play({room_drive().string()}));
    EXPECT_EQ(play.wait_for_exit(patience_of_a_drive()), 0) << testing::PrintToString(play.lines());
    EXPECT_TRUE(listener.wait_for_line("odometry 1"));
    const std::vector<HeardPose> poses = heard(listener);
    return poses.empty() ? std::nan("") : poses.front().T_odom_base.translation.x();
  };
  {
    Child daemon(service);
    EXPECT_NEAR(starts_at_x(), 0, kNear_m);
    status_when([](const json& s) { return s["lidars"]["front"]["heard_ms_ago"] > 300; });
    ASSERT_EQ(ctl({"reset", "--pose", "100,0,0,0,0,0"}).status, 0);
    ASSERT_EQ(ctl({"reload"}).status, 0);
    ASSERT_EQ(ctl({"reload"}).status, 0);
    daemon.signal(SIGTERM);
    ASSERT_EQ(daemon.wait_for_exit(), 0);
  }
  {
    Child daemon(service);
    EXPECT_NEAR(starts_at_x(), 100, kNear_m);
    ASSERT_EQ(ctl({"reset"}).status, 0);
    daemon.signal(SIGKILL);
    daemon.wait_for_exit();
  }
  Child daemon(service);
  EXPECT_NEAR(starts_at_x(), 0, kNear_m);
}

TEST_F(LifeCycle, ResetsAreCountedForTheLifeOfTheProcess) {
  Child daemon(locusd(config()));
  Child listener({CYCLONE_PEER, "0", "listen", "/locus"});
  ASSERT_TRUE(hears_the_service(listener));
  EXPECT_EQ(status()["resets"], 0) << "no estimate yet";
  {
    const Child play(endlessly(capture()));
    status_when([](const json& s) { return s["resets"] == 1 && s["beginning"] == "origin"; });
    ASSERT_EQ(ctl({"reset", "--pose", "100,0,0,0,0,0"}).status, 0);
    status_when([](const json& s) { return s["resets"] == 2 && s["beginning"] == "told"; });
  }
  EXPECT_TRUE(listener.wait_for_line("resets 2"));
  EXPECT_EQ(listener.lines_of("resets"), (std::vector<std::string>{"1", "2"}));
  ASSERT_EQ(ctl({"reload"}).status, 0);
  EXPECT_GE(status()["resets"], 2);
}

TEST_F(LifeCycle, ResetBeforeTheFirstSweepGivesNoWarningOfTheSavedState) {
  {
    Child daemon(locusd(config()));
    const Child play(endlessly(capture()));
    ASSERT_TRUE(daemon.wait_for_line("tracking"));
    daemon.signal(SIGTERM);
    ASSERT_EQ(daemon.wait_for_exit(), 0);
  }
  Child daemon(locusd(config()));
  ASSERT_TRUE(daemon.wait_for_line("DDS is up"));
  ASSERT_EQ(ctl({"reset"}).status, 0);
  const Child play(endlessly(capture()));
  ASSERT_TRUE(daemon.wait_for_line("tracking"));
  EXPECT_FALSE(daemon.has_line("does not match the saved state")) << testing::PrintToString(daemon.lines());
}

TEST_F(LifeCycle, MapIsCurrentAfterARequestThatTimedOut) {
  Child daemon(locusd(config()));
  ASSERT_TRUE(daemon.wait_for_line("DDS is up"));
  EXPECT_EQ(ctl({"save-map", file("none.pcd").string()}).status, 1) << "there is no lidar";
  const Child play(endlessly(capture()));
  status_when([](const json& s) { return s["sweeps"]["processed"] > 60; });
  std::array<std::uintmax_t, 2> bytes{};
  for (std::uintmax_t& size : bytes) {
    ASSERT_EQ(ctl({"save-map", file("map.pcd").string()}).status, 0);
    size = std::filesystem::file_size(file("map.pcd"));
  }
  EXPECT_GT(bytes[0], bytes[1] * 9 / 10) << "the first is as the second";
}

TEST_F(LifeCycle, FullLogDoesNotEndTheService) {
  NotifySocket systemd(file("notify"));
  Child daemon({"/bin/sh", "-c", std::string("exec ") + LOCUSD + " --config " + config().string() + " 2> /dev/full"});
  EXPECT_TRUE(systemd.hears("READY=1"));
  daemon.signal(SIGTERM);
  EXPECT_EQ(daemon.wait_for_exit(), 0);
}

TEST_F(LifeCycle, DdsNetworkMayComeUpLater) {
  Child daemon(locusd(config("dds: {interface: robot0}\n")));
  EXPECT_TRUE(daemon.wait_for_line("dds.interface: no network interface robot0; there are lo"));
  if (!add_interfaces())
    GTEST_SKIP() << "no pair of virtual interfaces: the kernel has no veth, or ip is missing";
  EXPECT_TRUE(daemon.wait_for_line("DDS is up: domain 0 on interface robot0"));
}

/// A robot whose estimates are received over a network interface of its own.
class DdsNetwork : public LifeCycle {
 protected:
  void SetUp() override {
    LifeCycle::SetUp();
    if (IsSkipped() || HasFatalFailure())
      return;
    if (!add_interfaces())
      GTEST_SKIP() << "no pair of virtual interfaces: the kernel has no veth, or ip is missing";
    daemon_.emplace(locusd(config("dds: {interface: robot0}\n")));
    ASSERT_TRUE(daemon_->wait_for_line("DDS is up"));
    listener_.emplace(std::vector<std::string>{CYCLONE_PEER, "0", "listen", "/locus", "robot0"});
    ASSERT_TRUE(hears_the_service(*listener_));
    play_.emplace(endlessly(capture())); // IMU and odometry by lo, where nothing receives them
  }

  void expect_estimates_are_heard() const {
    const auto estimates = [](const std::vector<std::string>& lines) {
      return std::ranges::count_if(lines, [](const std::string& line) { return line.starts_with("odometry "); });
    };
    const auto before = estimates(listener_->lines());
    EXPECT_TRUE(listener_->wait_until([&](const auto& lines) { return estimates(lines) > before + 5; }));
  }
  static void set_network(const char* up_or_down) {
    const std::string command = std::string("ip link set robot0 ") + up_or_down;
    ASSERT_EQ(std::system(command.c_str()), 0); // NOLINT(concurrency-mt-unsafe, cert-env33-c)
  }

  std::optional<Child> daemon_, listener_, play_;
};

/// After a network failure the subscribers receive again; the odometry has continued meanwhile.
TEST_F(DdsNetwork, RecoversFromAnOutage) {
  expect_estimates_are_heard();
  set_network("down");
  const auto processed = [](const json& s) { return s["sweeps"]["processed"].get<int>(); };
  const int before = processed(status());
  status_when([&](const json& s) { return processed(s) >= before + 20; });
  set_network("up");
  expect_estimates_are_heard();
}

TEST_F(DdsNetwork, OutageDelaysNoSweep) {
  expect_estimates_are_heard();
  set_network("down");
  const int before = status()["sweeps"]["seen"];
  const json after = status_when([&](const json& s) { return s["sweeps"]["seen"] >= before + 20; });
  EXPECT_EQ(after["sweeps"]["dropped"], 0);
}

TEST_F(LifeCycle, PortInUseEndsWithStatusOne) {
  const Child first(locusd(config()));
  ASSERT_TRUE(first.wait_for_line("DDS is up"));
  const ProgramRun second = run_program(LOCUSD, {"--config", config().string()});
  EXPECT_EQ(second.status, 1);
  EXPECT_NE(second.err.find("2368"), std::string::npos) << second.err;
}

/// Unplugs the lidar for 12 s: the odometry continues at its rate by dead reckoning, then relocalises.
TEST_F(LifeCycle, CablePullIsBridgedByDeadReckoning) {
  const Child daemon(led_locusd(config()));
  const Child listener({CYCLONE_PEER, "0", "listen", "/locus"});
  ASSERT_TRUE(hears_the_service(listener));
  Child play(leading_play({"--fail", "all-lidars:lost@4-16", capture().string()}));
  ASSERT_EQ(play.wait_for_exit(patience_of_a_drive()), 0) << testing::PrintToString(play.lines());
  EXPECT_TRUE(daemon.wait_for_line("dead reckoning"));
  EXPECT_TRUE(daemon.wait_for_line("lidar front: no data packet on UDP port 2368 for 5 s; check its power and cable"));
  EXPECT_TRUE(daemon.wait_for_line("lidar front: data received"));
  EXPECT_TRUE(listener.wait_until([](const auto& lines) {
    return std::ranges::count_if(lines, [](const std::string& line) { return line.starts_with("state "); }) > 190;
  }));
  const std::vector<HeardPose> poses = heard(listener);
  ASSERT_GT(poses.size(), 190U);
  Duration longest{};
  for (std::size_t i = 1; i < poses.size(); ++i)
    longest = std::max<Duration>(longest, poses[i].stamp - poses[i - 1].stamp);
  EXPECT_LT(longest, milliseconds{250});
  std::vector<HeardPose> fast = heard(listener, "odometry_fast");
  std::erase_if(fast, [&](const HeardPose& pose) {
    return pose.stamp < poses[50].stamp || pose.stamp > poses[150].stamp; // keeps ten seconds surely without lidar
  });
  EXPECT_GT(fast.size(), 1000U) << "at the rate of the IMU, but for what the listener is too slow for";
  const std::vector<std::string> states = listener.lines_of("state");
  EXPECT_GT(std::ranges::count(states, "2"), 100);
  ASSERT_GT(states.size(), 190U);
  EXPECT_EQ(states[185], "0") << "it tracks again before the end";
}

TEST_F(LifeCycle, DamagedStateIsNotUsed) {
  std::ofstream{file("state")} << "half of a sta";
  Child daemon(locusd(config()));
  EXPECT_TRUE(
      daemon.wait_for_line("starting without a saved state: " + file("state").string() + ": is truncated or damaged"));
}

TEST_F(LifeCycle, StateOfAnotherVersionIsNotUsed) {
  std::ofstream{file("state")} << "locusd 3 and so on";
  Child daemon(locusd(config()));
  EXPECT_TRUE(daemon.wait_for_line("starting without a saved state: " + file("state").string() +
                                   ": was written by another version"));
}

TEST_F(LifeCycle, OutdatedPoseIsNotUsed) {
  daemon::SavedState old;
  old.last.stamp = Stamp{daemon::read_clock(CLOCK_REALTIME)} - seconds{61};
  ASSERT_FALSE(daemon::write_state(file("state"), old));
  Child daemon(locusd(config()));
  EXPECT_TRUE(daemon.wait_for_line("starting without the saved pose: it is")) << testing::PrintToString(daemon.lines());
}

/// The robot may have been moved overnight, but has the same sensors.
TEST_F(LifeCycle, LearnedCalibrationOutlivesAnOutdatedPose) {
  const Config configured = *parse_config(read_text(config()), "config");
  daemon::SavedState old;
  old.last.stamp = Stamp{daemon::read_clock(CLOCK_REALTIME)} - std::chrono::hours{24};
  old.last.T_odom_base.translation.x() = 100.0;
  old.flat_ground = FlatGround::on;
  old.sources = daemon::ids_of(configured.motion_sources);
  for (std::size_t i = 0; i < configured.motion_sources.size(); ++i) {
    LearnedSource& learned = old.last.learned[i].emplace(as_configured(configured.motion_sources[i]));
    if (configured.motion_sources[i].kind == SourceKind::imu)
      learned.states[LearnedSource::kMounting + 2] = 0.02;
  }
  ASSERT_FALSE(daemon::write_state(file("state"), old));
  Child daemon(led_locusd(config()));
  ASSERT_TRUE(daemon.wait_for_line("starting without the saved pose: it is"));
  ASSERT_TRUE(daemon.wait_for_line("DDS is up"));
  ASSERT_EQ(ctl({"reload"}).status, 0) << "before anything is known of the robot";
  led_time().hold_at_ns = Duration{seconds{1}}.count(); // before the drive corrects what was learned
  Child play(leading_play({capture().string()}));
  const json status = status_when(
      [](const json& s) { return s["sweeps"]["processed"] > 2 && s["sources"]["imu"].contains("learned"); });
  EXPECT_LT(status["pose"]["xyz_m"][0].get<double>(), 10.0);
  EXPECT_EQ(status["flat_ground"], "off");
  EXPECT_GT(status["sources"]["imu"]["learned"]["mounting_deg"]["value"][2].get<double>(), 0.5);
}

TEST_F(LifeCycle, FullDiskLosesOnlyTheState) {
  std::filesystem::create_directory(file("full"));
  if (unshare(CLONE_NEWNS) != 0 || mount("none", "/", nullptr, MS_REC | MS_PRIVATE, nullptr) != 0 ||
      mount("tmpfs", file("full").c_str(), "tmpfs", 0, "size=4k") != 0)
    GTEST_SKIP() << "no file system of one's own: run as root";
  setenv("STATE_DIRECTORY", file("full").c_str(), 1); // NOLINT(concurrency-mt-unsafe)
  {
    Child daemon(locusd(config()));
    ASSERT_TRUE(daemon.wait_for_line("DDS is up"));
    const Child play(endlessly(capture()));
    EXPECT_TRUE(daemon.wait_for_line("the state cannot be saved (No space left on device)"));
    status_when([](const json& s) { return s["sweeps"]["processed"] > 50 && s["state"] == "tracking"; });
  }
  umount2(file("full").c_str(), MNT_DETACH);
}

/// As in a container with --cap-drop=ALL and --read-only: each missing part is reported once, with its remedy.
TEST_F(LifeCycle, RunsWithoutCapabilitiesAndWritableFolders) {
  if (geteuid() != 0)
    GTEST_SKIP() << "only root can give up capabilities";
  setenv("RUNTIME_DIRECTORY", "/proc/none", 1); // NOLINT(concurrency-mt-unsafe)
  setenv("STATE_DIRECTORY", "/proc/none", 1);   // NOLINT(concurrency-mt-unsafe)
  std::vector<std::string> command{"/usr/bin/setpriv", "--bounding-set=-all", "--inh-caps=-all", "--no-new-privs"};
  std::ranges::copy(locusd(config()), std::back_inserter(command));
  Child daemon(command);
  ASSERT_TRUE(daemon.wait_for_line("DDS is up")) << testing::PrintToString(daemon.lines());
  const Child play(endlessly(capture()));
  EXPECT_TRUE(daemon.wait_for_line("tracking"));
  EXPECT_TRUE(daemon.wait_for_line("the state cannot be saved"));
  daemon.signal(SIGTERM);
  EXPECT_EQ(daemon.wait_for_exit(), 0);
  const auto lines_with = [&](const std::string& part) {
    return std::ranges::count_if(daemon.lines(), [&](const std::string& line) { return contains(line, part); });
  };
  EXPECT_EQ(lines_with("set RUNTIME_DIRECTORY to a writable folder"), 1);
  EXPECT_EQ(lines_with("make its folder writable for locusd"), 2) << "once while it runs, once at its end";
}

TEST_F(LifeCycle, ControlCommandsTakeEffect) {
  Child daemon(led_locusd(config()));
  ASSERT_TRUE(daemon.wait_for_line("DDS is up"));
  led_time().hold_at_ns = Duration{seconds{10}}.count();
  Child play(leading_play({capture().string()}));
  ASSERT_TRUE(is_held());
  const auto is_used = [](const json& source) {
    return source["health"] == "healthy" && source.contains("innovation") && source["innovation"]["test_ratio"] > 0.0;
  };
  const json status = status_when([&](const json& s) {
    return s["sweeps"]["processed"] > 30 && s["state"] == "tracking" && s["sources"]["imu"]["health"] == "healthy" &&
           is_used(s["sources"]["wio"]);
  });
  for (const char* key :
       {"version", "config_sha256", "packets", "sweeps", "process_ms", "process_cpu_ms", "stage_ms", "points",
        "iterations_mean", "sources", "state", "age_ms", "rate_hz", "pose", "covariance", "observability", "lidars"})
    EXPECT_TRUE(status.contains(key)) << key;
  EXPECT_GT(status["rate_hz"].get<double>(), 0);
  EXPECT_EQ(status["lidars"]["front"]["model"], "VLP-16");
  EXPECT_EQ(status["sources"]["wio"]["innovation"]["value"].size(), 6U);
  EXPECT_GT(status["sources"]["wio"]["innovation"]["sd"][0].get<double>(), 0.0);
  EXPECT_GT(status["sources"]["wio"]["innovation"]["test_ratio"].get<double>(), 0.0);
  EXPECT_GE(status["sources"]["wio"]["last_used_ms_ago"].get<double>(), 0.0);
  EXPECT_EQ(status["observability"].size(), 6U);
  EXPECT_EQ(status["covariance"].size(), 36U);

  const ProgramRun text = ctl({"status"});
  EXPECT_LE(lines_of(text.out).size(), 24U);
  for (const std::string& line : lines_of(text.out))
    EXPECT_LE(line.size(), 80U) << line;

  EXPECT_EQ(ctl({"flat-ground", "on"}).status, 0);
  EXPECT_EQ(this->status()["flat_ground"], "on");
  EXPECT_EQ(ctl({"flat-ground", "perhaps"}).status, 2);

  const ProgramRun calibration = ctl({"calibration"});
  EXPECT_EQ(calibration.status, 0) << calibration.err;
  for (const char* const figure : {"late_ms", "mounting_deg z (yaw)", "yaw_scale", "since 20"})
    EXPECT_NE(calibration.out.find(figure), std::string::npos) << calibration.out;
  EXPECT_EQ(ctl({"calibration", "--yaml"}).out.find("error"), std::string::npos);
  const json learned = status_when([](const json& s) { return s["sources"]["imu"].contains("learned"); });
  EXPECT_EQ(learned["sources"]["imu"]["learned"]["late_ms"]["configured"], 0.0);

  EXPECT_EQ(ctl({"reset", "--pose", "100,50,0,0,0,90"}).status, 0);
  EXPECT_TRUE(daemon.has_line("run ended: ")) << testing::PrintToString(daemon.lines());
  led_time().hold_at_ns = 0;
  ASSERT_EQ(play.wait_for_exit(patience_of_a_drive()), 0) << testing::PrintToString(play.lines());
  const json reset = status_when([](const json& s) { return s["sweeps"]["processed"] > 5; });
  constexpr double kRoom_m = 13; // the room's diagonal: the robot continues to drive
  EXPECT_NEAR(reset["pose"]["xyz_m"][0].get<double>(), 100, kRoom_m);
  EXPECT_NEAR(reset["pose"]["xyz_m"][1].get<double>(), 50, kRoom_m);

  const Child lidar(endlessly(capture()));
  status_when([](const json& s) { return s["lidars"]["front"]["heard_ms_ago"] < 1000; });
  EXPECT_EQ(ctl({"save-map", file("map.pcd").string()}).status, 0);
  EXPECT_NE(read_text(file("map.pcd")).find("FIELDS x y z"), std::string::npos);
  const ProgramRun sensors = ctl({"sensors"});
  EXPECT_EQ(sensors.status, 0) << sensors.err;
  EXPECT_NE(sensors.out.find("VLP-16"), std::string::npos) << sensors.out;
  EXPECT_NE(sensors.out.find("port: 2368"), std::string::npos) << sensors.out;

  daemon.signal(SIGTERM);
  ASSERT_EQ(daemon.wait_for_exit(), 0);
  const std::string last = daemon.lines().back();
  EXPECT_TRUE(last.starts_with("locusd: stopped: ")) << last;
  EXPECT_TRUE(last.find(" (wio); trajectory ") != std::string::npos ||
              last.find(" (imu); trajectory ") != std::string::npos)
      << last;
}

TEST_F(LifeCycle, ControlWithoutAServiceExplainsHowToStartIt) {
  const ProgramRun run = ctl({"status"});
  EXPECT_EQ(run.status, 1);
  EXPECT_NE(run.err.find("no service answers"), std::string::npos);
}

/// Packets arrive thirty times as fast as they were fired, by the sensor's clock: 3 ms per sweep. The configuration
/// makes processing slow.
TEST_F(LifeCycle, OverloadDropsSweepsAndNeverMakesEstimatesOlder) {
  std::string text = read_text(config("segment_filter: {enabled: false}\nscan_to_scan: {mode: always}\nthreads: 1\n"));
  text.replace(text.find("{name: front,"), 13, "{name: front, time: sensor,");
  std::ofstream{file("overloaded.yaml")} << text;
  const Child daemon(locusd(file("overloaded.yaml")));
  ASSERT_TRUE(daemon.wait_for_line("DDS is up"));
  play_to_end({"--speed", "30"});
  std::this_thread::sleep_for(seconds{1});
  const json status = this->status();
  const json& sweeps = status["sweeps"];
  EXPECT_NEAR(sweeps["seen"].get<int>(), 200, 2);
  EXPECT_EQ(sweeps["seen"].get<int>(),
            sweeps["processed"].get<int>() + sweeps["dropped"].get<int>() + sweeps["failed"].get<int>());
  EXPECT_GT(sweeps["dropped"].get<int>(), 20) << "else it was no overload";
  const auto of = [&](const char* figure, const char* share) { return status[figure][share].get<double>(); };
  constexpr double kPeriod_ms = 100.0 / 30;
  RecordProperty("dropped", sweeps["dropped"].get<int>());
  RecordProperty("process_p50_us", static_cast<int>(1e3 * of("process_ms", "p50")));
  RecordProperty("process_cpu_p50_us", static_cast<int>(1e3 * of("process_cpu_ms", "p50")));
  EXPECT_LT(of("process_ms", "p50"), kPeriod_ms + 1.2 * of("process_cpu_ms", "p50"));
  EXPECT_LT(of("process_ms", "max"), 200.0) << "a queue would be seconds long at the end";
}

TEST_F(LifeCycle, SocketsOfSystemdAreUsed) {
  Child daemon({"/usr/bin/systemd-socket-activate", "--datagram", "--listen", "2368", "-E", "RUNTIME_DIRECTORY", "-E",
                "STATE_DIRECTORY", LOCUSD, "--config", config().string()});
  ASSERT_TRUE(daemon.wait_for_line("Listening on")) << testing::PrintToString(daemon.lines());
  const Child play(endlessly(capture()));
  EXPECT_TRUE(daemon.wait_for_line("tracking")) << testing::PrintToString(daemon.lines());
  status_when([](const json& s) { return s["lidars"]["front"]["source_ip"] == "127.0.0.1"; });
}

} // namespace
} // namespace locus::test
