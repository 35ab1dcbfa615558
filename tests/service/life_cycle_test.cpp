// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <fstream>
#include <set>
#include <thread>

#include <fmt/format.h>
#include <sched.h>
#include <sys/mount.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include "daemon/machine_time.hpp"
#include "daemon/service/saved_state.hpp"
#include "drivers/motion_files.hpp"
#include "drivers/udp_socket.hpp"
#include "service/robot_network.hpp"
#include "service/undisturbed.hpp"
#include "support/errors.hpp"

namespace locus::test {
namespace {

using nlohmann::json;
using std::chrono::milliseconds;
using std::chrono::seconds;

/// What systemd would hear of the service.
class NotifySocket {
 public:
  explicit NotifySocket(const std::filesystem::path& path) : socket_(::socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0)) {
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    path.native().copy(address.sun_path, sizeof(address.sun_path) - 1);
    EXPECT_EQ(bind(socket_, reinterpret_cast<const sockaddr*>(&address), sizeof(address)), 0);
    const timeval patience{0, 100'000};
    setsockopt(socket_, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof(patience));
    setenv("NOTIFY_SOCKET", path.c_str(), 1); // NOLINT(concurrency-mt-unsafe): before the program is started
  }
  ~NotifySocket() {
    unsetenv("NOTIFY_SOCKET"); // NOLINT(concurrency-mt-unsafe)
    close(socket_);
  }
  NotifySocket(const NotifySocket&) = delete;
  NotifySocket& operator=(const NotifySocket&) = delete;

  /// Whether a message with this word comes in time; all that come are counted.
  bool hears(const std::string& word, Duration timeout) {
    const auto give_up = std::chrono::steady_clock::now() + timeout;
    while (std::chrono::steady_clock::now() < give_up) {
      std::array<char, 4096> text{};
      const ssize_t size = recv(socket_, text.data(), text.size(), 0);
      if (size > 0 && std::string(text.data(), static_cast<std::size_t>(size)).find(word) != std::string::npos)
        return true;
    }
    return false;
  }

 private:
  int socket_;
};

class LifeCycle : public RobotNetwork {
 protected:
  static void play_to_end(std::vector<std::string> options = {}) {
    options.insert(options.begin(), LOCUS_PLAY);
    options.push_back(capture().string());
    Child play(undisturbed(options));
    EXPECT_EQ(play.wait_for_exit(seconds{60}), 0) << testing::PrintToString(play.lines());
  }

  /// A configuration with another value of a key of the lidar.
  [[nodiscard]] std::filesystem::path lidar_with(const std::string& key_and_value) const {
    std::string text = read_text(capture() / "config.yaml");
    const std::string name = "name: front", key = key_and_value.substr(0, key_and_value.find(' '));
    if (const std::size_t at = text.find(key, text.find(name)); at != std::string::npos)
      text.replace(at, text.find_first_of(",}\n", at) - at, key_and_value);
    else
      text.replace(text.find(name), name.size(), name + ", " + key_and_value);
    std::ofstream{file("wrong.yaml")} << text;
    return file("wrong.yaml");
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

TEST_F(LifeCycle, CalibrationThatCannotBeReadIsAWrongConfiguration) {
  for (const char* option : {"--check-config", "--print-config"}) {
    const ProgramRun bad = run_program(LOCUSD, {"--config", lidar_with("calibration: nothere.yaml").string(), option});
    EXPECT_EQ(bad.status, 2) << option;
    EXPECT_EQ(bad.out, "");
    EXPECT_TRUE(contains(bad.err, "lidars.front.calibration: nothere.yaml: cannot be read")) << bad.err;
  }
  EXPECT_EQ(run_program(LOCUSD, {"--config", file("wrong.yaml").string()}).status, 2);
}

/// Ready does not wait for sensors, the watchdog is fed without any, a stop is told and takes less than a second.
TEST_F(LifeCycle, SystemdIsToldOfStartReloadStopAndThatThreadsLive) {
  NotifySocket systemd(file("notify"));
  setenv("WATCHDOG_USEC", "600000", 1); // NOLINT(concurrency-mt-unsafe)
  Child daemon(undisturbed(locusd(config())));
  unsetenv("WATCHDOG_USEC"); // NOLINT(concurrency-mt-unsafe)
  EXPECT_TRUE(systemd.hears("READY=1", seconds{3}));
  EXPECT_TRUE(systemd.hears("WATCHDOG=1", seconds{2}));
  EXPECT_TRUE(systemd.hears("WATCHDOG=1", seconds{1}));
  EXPECT_TRUE(systemd.hears("STATUS=Waiting for the first lidar packet", seconds{3}));
  daemon.signal(SIGHUP);
  EXPECT_TRUE(systemd.hears("RELOADING=1", seconds{2}));
  EXPECT_TRUE(systemd.hears("READY=1", seconds{2}));
  daemon.signal(SIGTERM);
  EXPECT_TRUE(systemd.hears("STOPPING=1", seconds{1}));
  EXPECT_EQ(daemon.wait_for_exit(seconds{1}), 0);
}

TEST_F(LifeCycle, SensorsThatAreNotHeardAreNamedWithTheInterfaceOfDds) {
  Child daemon(undisturbed(locusd(config())));
  EXPECT_TRUE(daemon.wait_for_line("motion source wio: not heard", seconds{7}));
  EXPECT_TRUE(daemon.wait_for_line("nobody is seen that publishes /wheel_odometry; DDS listens on interface lo",
                                   milliseconds{10}));
  EXPECT_TRUE(daemon.wait_for_line("lidar front: no data packet on UDP port 2368", seconds{1}));
  EXPECT_EQ(status()["state"], "waiting");
  Child play(undisturbed({LOCUS_PLAY, capture().string()})); // switched on at last
  EXPECT_TRUE(daemon.wait_for_line("tracking", seconds{8}));
}

/// What is said changes with what is found: at first nothing comes.
TEST_F(LifeCycle, LidarOfAnotherAddressIsNamedWithBoth) {
  const std::filesystem::path wrong = lidar_with("source_ip: 192.168.1.77");
  Child daemon(undisturbed(locusd(wrong)));
  ASSERT_TRUE(daemon.wait_for_line("lidar front: no data packet on UDP port 2368 for 5 s; look at its power and cable",
                                   seconds{8}));
  const Child play(undisturbed({LOCUS_PLAY, capture().string()}));
  EXPECT_TRUE(daemon.wait_for_line("; packets come from 127.0.0.1, configured is 192.168.1.77: set "
                                   "lidars.front.source_ip to that of the lidar",
                                   seconds{5}))
      << testing::PrintToString(daemon.lines());
  const std::string shown = ctl({"status"}).out;
  EXPECT_NE(shown.find("refused: sender "), std::string::npos) << shown;
  EXPECT_NE(shown.find("the last sender: 127.0.0.1"), std::string::npos) << shown;
}

TEST_F(LifeCycle, LidarOnAnotherPortIsToldByItsPositionPackets) {
  const std::filesystem::path wrong = lidar_with("port: 2390");
  Child daemon(undisturbed(locusd(wrong)));
  const Child play(undisturbed({LOCUS_PLAY, capture().string()}));
  EXPECT_TRUE(
      daemon.wait_for_line("lidar front: no data packet on UDP port 2390 for 5 s; its position packets come, so "
                           "it is on and sends the others elsewhere: locusctl sensors tells to which port",
                           seconds{8}))
      << testing::PrintToString(daemon.lines());
}

TEST_F(LifeCycle, AccelerationsInGAreNamed) {
  const std::filesystem::path drive = file("in_g");
  std::filesystem::copy(capture(), drive);
  auto samples = MotionSamples<ImuSample>::open((capture() / "imu.csv").string());
  ASSERT_TRUE(samples) << samples.error();
  std::ofstream imu(drive / "imu.csv");
  for (const ImuSample& sample : samples->drain()) {
    imu << sample.stamp.time_since_epoch().count();
    for (const Eigen::Vector3d& axes :
         {sample.angular_velocity_radps, Eigen::Vector3d(sample.specific_force_mps2 / 9.80665)})
      imu << ',' << axes.x() << ',' << axes.y() << ',' << axes.z();
    imu << '\n';
  }
  imu.close();
  Child daemon(undisturbed(locusd(config())));
  ASSERT_TRUE(daemon.wait_for_line("DDS is up", seconds{10}));
  const Child play(undisturbed({LOCUS_PLAY, drive.string()}));
  EXPECT_TRUE(daemon.wait_for_line("motion source imu reports accelerations in g", seconds{15}))
      << testing::PrintToString(daemon.lines());
  EXPECT_NE(ctl({"status"}).out.find("reports accelerations in g"), std::string::npos);
}

TEST_F(LifeCycle, SweepsThatAreDroppedAreSaidWithTheReason) {
  Child daemon(undisturbed(locusd(config())));
  ASSERT_TRUE(daemon.wait_for_line("DDS is up", seconds{10}));
  const Child play(undisturbed({LOCUS_PLAY, capture().string()}));
  ASSERT_TRUE(daemon.wait_for_line("tracking", seconds{10}));
  const Child hang({HANG_THREAD, std::to_string(daemon.pid()), "odometry"});
  EXPECT_TRUE(daemon.wait_for_line("this computer is too busy: ", seconds{12}))
      << testing::PrintToString(daemon.lines());
}

TEST_F(LifeCycle, SecondServiceLeavesTheSocketOfTheFirstAlone) {
  const Child first(locusd(config()));
  ASSERT_TRUE(first.wait_for_line("DDS is up", seconds{10}));
  {
    const Child second(locusd(lidar_with("port: 2390")));
    EXPECT_TRUE(second.wait_for_line("control: another service answers there", seconds{10}))
        << testing::PrintToString(second.lines());
  }
  EXPECT_EQ(status()["lidars"]["front"]["port"], 2368);
}

TEST_F(LifeCycle, BadConfigurationAtReloadLeavesTheOldOneInForce) {
  const std::filesystem::path file = config();
  Child daemon(locusd(file));
  ASSERT_TRUE(daemon.wait_for_line("DDS is up", seconds{10}));
  std::ofstream{file, std::ios::app} << "no_such_key: 1\n";
  const ProgramRun refused = ctl({"reload"});
  EXPECT_EQ(refused.status, 2);
  EXPECT_NE(refused.err.find("no_such_key"), std::string::npos) << refused.err;
  EXPECT_TRUE(daemon.wait_for_line("the old configuration stays in force", seconds{1}));
  EXPECT_EQ(status()["state"], "waiting");
  static_cast<void>(config("threads: 1\n"));
  EXPECT_EQ(ctl({"reload"}).status, 0);
  EXPECT_EQ(status()["threads"], 1);
}

TEST_F(LifeCycle, PortThatIsTakenAtReloadLeavesTheOldConfigurationInForce) {
  const std::filesystem::path file = config("flat_ground: off\n");
  Child daemon(locusd(file));
  ASSERT_TRUE(daemon.wait_for_line("DDS is up", seconds{10}));
  const auto taken = UdpSocket::open(2399);
  ASSERT_TRUE(taken) << taken.error();
  std::filesystem::copy_file(lidar_with("port: 2399"), file, std::filesystem::copy_options::overwrite_existing);
  std::ofstream{file, std::ios::app} << "flat_ground: on\n";
  const ProgramRun refused = ctl({"reload"});
  EXPECT_EQ(refused.status, 1);
  EXPECT_TRUE(contains(refused.err, "UDP port 2399")) << refused.err;
  EXPECT_EQ(status()["lidars"]["front"]["port"], 2368);
  EXPECT_EQ(status()["flat_ground"], "off");
  ASSERT_EQ(ctl({"flat-ground", "auto"}).status, 0);
  EXPECT_EQ(ctl({"reload"}).status, 1);
  EXPECT_EQ(status()["flat_ground"], "auto");
}

/// Each costs more than the time to the next one.
TEST_F(LifeCycle, ReloadsThatComeTooFastHoldUpNeitherAnswersNorTheEnd) {
  Child daemon(locusd(config()));
  ASSERT_TRUE(daemon.wait_for_line("DDS is up", seconds{10}));
  std::atomic<bool> stopping{false};
  std::thread pest([&] {
    for (; !stopping; std::this_thread::sleep_for(milliseconds{20}))
      daemon.signal(SIGHUP);
  });
  std::this_thread::sleep_for(seconds{1});
  EXPECT_EQ(status()["state"], "waiting");
  daemon.signal(SIGTERM);
  EXPECT_TRUE(daemon.wait_for_line("stopped", seconds{3}));
  stopping = true;
  pest.join();
  EXPECT_EQ(daemon.wait_for_exit(seconds{5}), 0);
}

/// Neither the new configuration nor the old one works: systemd is to start it again, from where the robot is.
TEST_F(LifeCycle, ReloadThatFailsTwiceEndsTheServiceWithItsStateSaved) {
  for (const bool by_signal : {false, true}) {
    std::ofstream calibration{this->file("unit.yaml")};
    calibration << "num_lasers: 16\nlasers:\n";
    for (int laser = 0; laser < 16; ++laser)
      calibration << fmt::format("- {{laser_id: {}, vert_correction: {}}}\n", laser, laser / 64.0);
    calibration.close();
    const std::filesystem::path file = config();
    const std::string right = read_text(file);
    std::filesystem::copy_file(lidar_with("calibration: " + this->file("unit.yaml").string()), file,
                               std::filesystem::copy_options::overwrite_existing);
    Child daemon(locusd(file));
    ASSERT_TRUE(daemon.wait_for_line("DDS is up", seconds{10}));
    ASSERT_EQ(ctl({"reset", "--pose", "1,2,0,0,0,0"}).status, 0);
    std::filesystem::remove(this->file("unit.yaml"));
    const auto taken = UdpSocket::open(2399);
    ASSERT_TRUE(taken) << taken.error();
    std::filesystem::copy_file(lidar_with("port: 2399"), file, std::filesystem::copy_options::overwrite_existing);
    for (int signal = 0; by_signal && signal < 50; ++signal, std::this_thread::sleep_for(milliseconds{5}))
      daemon.signal(SIGHUP);
    if (!by_signal) {
      const ProgramRun reload = ctl({"reload"});
      EXPECT_TRUE(contains(reload.err, "nor does the old configuration work any more")) << reload.err;
    }
    EXPECT_EQ(daemon.wait_for_exit(seconds{5}), 1) << by_signal;
    const auto state = daemon::load_state(this->file("state"));
    ASSERT_TRUE(state) << state.error();
    EXPECT_EQ(state->last.T_odom_base.translation.y(), 2);
    std::ofstream{file} << right;
  }
}

TEST_F(LifeCycle, ResetWithoutLidarOutlivesAReloadAndARestart) {
  const auto starts_at_x = [this](Child& daemon) {
    const Child play(undisturbed({LOCUS_PLAY, capture().string()}));
    EXPECT_TRUE(daemon.wait_for_line("tracking", seconds{10}));
    return status()["pose"]["xyz_m"][0].get<double>();
  };
  {
    Child daemon(undisturbed(locusd(config())));
    ASSERT_TRUE(daemon.wait_for_line("DDS is up", seconds{10}));
    starts_at_x(daemon);
    std::this_thread::sleep_for(seconds{1});
    ASSERT_EQ(ctl({"reset", "--pose", "100,0,0,0,0,0"}).status, 0);
    ASSERT_EQ(ctl({"reload"}).status, 0);
    ASSERT_EQ(ctl({"reload"}).status, 0);
    daemon.signal(SIGTERM);
    ASSERT_EQ(daemon.wait_for_exit(seconds{5}), 0);
  }
  {
    Child daemon(undisturbed(locusd(config())));
    EXPECT_NEAR(starts_at_x(daemon), 100, 5);
    ASSERT_EQ(ctl({"reset"}).status, 0);
    daemon.signal(SIGKILL);
    daemon.wait_for_exit(seconds{5});
  }
  Child daemon(undisturbed(locusd(config())));
  EXPECT_NEAR(starts_at_x(daemon), 0, 5);
}

TEST_F(LifeCycle, ResetBeforeTheFirstSweepIsNoDoubtAboutTheSavedState) {
  {
    Child daemon(undisturbed(locusd(config())));
    const Child play(undisturbed({LOCUS_PLAY, capture().string()}));
    ASSERT_TRUE(daemon.wait_for_line("tracking", seconds{10}));
    daemon.signal(SIGTERM);
    ASSERT_EQ(daemon.wait_for_exit(seconds{5}), 0);
  }
  Child daemon(undisturbed(locusd(config())));
  ASSERT_TRUE(daemon.wait_for_line("DDS is up", seconds{10}));
  ASSERT_EQ(ctl({"reset"}).status, 0);
  const Child play(undisturbed({LOCUS_PLAY, capture().string()}));
  ASSERT_TRUE(daemon.wait_for_line("tracking", seconds{10}));
  EXPECT_FALSE(daemon.wait_for_line("does not fit the saved state", {})) << testing::PrintToString(daemon.lines());
}

TEST_F(LifeCycle, SweepsThatAreShorterThanATurnAreSaidOnce) {
  Child daemon(undisturbed(locusd(config("sweep_period_ms: 50\n"))));
  ASSERT_TRUE(daemon.wait_for_line("DDS is up", seconds{10}));
  const Child play(undisturbed({LOCUS_PLAY, capture().string()}));
  EXPECT_TRUE(daemon.wait_for_line("lidar front: turns in 100 ms, so a sweep of 50 ms sees a part", seconds{10}));
  std::this_thread::sleep_for(seconds{1});
  const auto lines = daemon.lines();
  EXPECT_EQ(std::ranges::count_if(lines, [](const std::string& line) { return contains(line, "turns in 100 ms"); }), 1);
}

TEST_F(LifeCycle, MapIsThatOfTheMomentAlsoAfterOneThatNeverCame) {
  Child daemon(undisturbed(locusd(config())));
  ASSERT_TRUE(daemon.wait_for_line("DDS is up", seconds{10}));
  EXPECT_EQ(ctl({"save-map", file("none.pcd").string()}).status, 1) << "there is no lidar";
  const Child play(undisturbed({LOCUS_PLAY, capture().string()}));
  ASSERT_TRUE(daemon.wait_for_line("tracking", seconds{10}));
  std::this_thread::sleep_for(seconds{3});
  std::array<std::uintmax_t, 2> bytes{};
  for (std::uintmax_t& size : bytes) {
    ASSERT_EQ(ctl({"save-map", file("map.pcd").string()}).status, 0);
    size = std::filesystem::file_size(file("map.pcd"));
  }
  EXPECT_GT(bytes[0], bytes[1] * 9 / 10) << "the first is as the second";
}

TEST_F(LifeCycle, LogThatIsFullEndsNoService) {
  const std::string command =
      std::string("exec timeout --preserve-status 3 ") + LOCUSD + " --config " + config().string() + " 2> /dev/full";
  EXPECT_EQ(run_program("/bin/sh", {"-c", command}).status, 0);
}

TEST_F(LifeCycle, NetworkOfDdsMayComeLater) {
  Child daemon(locusd(config("dds: {interface: robot0}\n")));
  EXPECT_TRUE(daemon.wait_for_line("dds.interface: there is no network interface robot0; there are lo", seconds{5}));
  for (const char* command : {"ip link add robot0 type veth peer name robot1", "ip addr add 10.7.0.1/24 dev robot0",
                              "ip link set robot1 up", "ip link set robot0 up"})
    ASSERT_EQ(std::system(command), 0); // NOLINT(concurrency-mt-unsafe, cert-env33-c)
  EXPECT_TRUE(daemon.wait_for_line("DDS is up: domain 0 on interface robot0", seconds{20}));
}

/// Its network fails and comes back: those who listened hear it again, and nothing else was disturbed.
TEST_F(LifeCycle, NetworkOfDdsMayFailForAWhile) {
  for (const char* command : {"ip link add robot0 type veth peer name robot1", "ip addr add 10.7.0.1/24 dev robot0",
                              "ip link set robot1 up", "ip link set robot0 up"})
    ASSERT_EQ(std::system(command), 0); // NOLINT(concurrency-mt-unsafe, cert-env33-c)
  Child daemon(undisturbed(locusd(config("dds: {interface: robot0}\n"))));
  ASSERT_TRUE(daemon.wait_for_line("DDS is up", seconds{10}));
  const Child listener({CYCLONE_PEER, "0", "listen", "/locus", "robot0"});
  const Child play(undisturbed({LOCUS_PLAY, capture().string()})); // its IMU and odometry go by lo, to nobody
  const auto estimates = [](const std::vector<std::string>& lines) {
    return std::ranges::count_if(lines, [](const std::string& line) { return line.starts_with("odometry "); });
  };
  const auto hears = [&] {
    const auto before = estimates(listener.lines());
    return listener.wait_until(seconds{10}, [&](const auto& lines) { return estimates(lines) > before + 5; });
  };
  ASSERT_TRUE(hears());
  const auto processed = [&] { return status()["sweeps"]["processed"].get<int>(); };
  ASSERT_EQ(std::system("ip link set robot0 down"), 0); // NOLINT(concurrency-mt-unsafe, cert-env33-c)
  std::this_thread::sleep_for(milliseconds{500});
  const int before = processed();
  std::this_thread::sleep_for(seconds{2});
  EXPECT_GE(processed(), before + 18);
  ASSERT_EQ(std::system("ip link set robot0 up"), 0); // NOLINT(concurrency-mt-unsafe, cert-env33-c)
  EXPECT_TRUE(hears());
  EXPECT_EQ(status()["sweeps"]["dropped"], 0);
}

TEST_F(LifeCycle, PortThatIsTakenEndsItWithStatusOne) {
  const Child first(locusd(config()));
  ASSERT_TRUE(first.wait_for_line("DDS is up", seconds{10}));
  const ProgramRun second = run_program(LOCUSD, {"--config", config().string()});
  EXPECT_EQ(second.status, 1);
  EXPECT_NE(second.err.find("2368"), std::string::npos) << second.err;
}

/// Without the right to go beyond what the kernel allows to all, as systemd starts it.
TEST_F(LifeCycle, BufferThatIsSmallerThanAskedForIsSaidWithTheSettingToChange) {
  int allowed = UdpSocket::kWantedBufferBytes;
  std::ifstream("/proc/sys/net/core/rmem_max") >> allowed;
  if (allowed >= UdpSocket::kWantedBufferBytes)
    GTEST_SKIP() << "this machine gives all that is asked for";
  std::vector<std::string> command = locusd(config());
  if (geteuid() == 0)
    command.insert(command.begin(), {"/usr/bin/setpriv", "--bounding-set", "-net_admin"});
  Child daemon(command);
  EXPECT_TRUE(
      daemon.wait_for_line(fmt::format("the kernel gives lidar sockets {} bytes of the 8388608 asked for: packets "
                                       "will be lost under load; sysctl net.core.rmem_max=8388608",
                                       allowed),
                           seconds{5}))
      << testing::PrintToString(daemon.lines());
}

/// The cable of the lidar is pulled for 12 s: odometry goes on at its pace, dead-reckoned, and finds back.
TEST_F(LifeCycle, CablePullIsBridgedByDeadReckoning) {
  Child daemon(undisturbed(locusd(config())));
  Child listener({CYCLONE_PEER, "0", "listen", "/locus"});
  ASSERT_TRUE(daemon.wait_for_line("DDS is up", seconds{10}));
  play_to_end({"--fail", "all-lidars:lost@4-16"});
  EXPECT_TRUE(daemon.wait_for_line("dead reckoning", milliseconds{10}));
  EXPECT_TRUE(daemon.wait_for_line("lidar front: no data packet on UDP port 2368 for 5 s; look at its power and cable",
                                   milliseconds{10}));
  EXPECT_TRUE(daemon.wait_for_line("lidar front: heard", milliseconds{10}));
  const std::vector<HeardPose> poses = heard(listener);
  EXPECT_GT(poses.size(), 190U);
  Duration longest{};
  for (std::size_t i = 1; i < poses.size(); ++i)
    longest = std::max<Duration>(longest, poses[i].stamp - poses[i - 1].stamp);
  EXPECT_LT(longest, milliseconds{250});
  std::vector<HeardPose> fast = heard(listener, "odometry_fast");
  std::erase_if(fast, [&](const HeardPose& pose) {
    return pose.stamp < poses[50].stamp || pose.stamp > poses[150].stamp; // amid the ten seconds that are surely blind
  });
  EXPECT_GT(fast.size(), 1800U) << "at the rate of the IMU";
  const std::vector<std::string> states = listener.lines_of("state");
  EXPECT_GT(std::ranges::count(states, "2"), 100);
  ASSERT_GT(states.size(), 190U);
  EXPECT_EQ(states[185], "0") << "it tracks again before the end";
}

/// In a plant. After a crash nothing but the whereabouts of the last sweep tells how far it came since the map was
/// saved.
TEST_F(LifeCycle, StoppedAndKilledInMidDriveItGoesOnWhereTheRobotIs) {
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

TEST_F(LifeCycle, DamagedStateIsAFreshStart) {
  std::ofstream{file("state")} << "half of a sta";
  Child daemon(undisturbed(locusd(config())));
  EXPECT_TRUE(
      daemon.wait_for_line("a fresh start: " + file("state").string() + ": is cut short or damaged", seconds{3}));
}

TEST_F(LifeCycle, StateOfAnotherTimeIsAFreshStart) {
  daemon::SavedState old;
  old.last.stamp = Stamp{daemon::read_clock(CLOCK_REALTIME)} - seconds{61};
  ASSERT_FALSE(daemon::write_state(file("state"), old));
  Child daemon(undisturbed(locusd(config())));
  EXPECT_TRUE(daemon.wait_for_line("a fresh start: the saved state is", seconds{3}))
      << testing::PrintToString(daemon.lines());
}

TEST_F(LifeCycle, FullDiskCostsTheStateAndNothingElse) {
  std::filesystem::create_directory(file("full"));
  if (unshare(CLONE_NEWNS) != 0 || mount("none", "/", nullptr, MS_REC | MS_PRIVATE, nullptr) != 0 ||
      mount("tmpfs", file("full").c_str(), "tmpfs", 0, "size=4k") != 0)
    GTEST_SKIP() << "no file system of one's own: run as root";
  setenv("STATE_DIRECTORY", file("full").c_str(), 1); // NOLINT(concurrency-mt-unsafe)
  {
    Child daemon(undisturbed(locusd(config())));
    ASSERT_TRUE(daemon.wait_for_line("DDS is up", seconds{10}));
    Child play(undisturbed({LOCUS_PLAY, capture().string()}));
    EXPECT_TRUE(daemon.wait_for_line("the state cannot be saved (No space left on device)", seconds{10}));
    EXPECT_TRUE(status_comes([](const json& s) { return s["sweeps"]["processed"].get<int>() > 50; }, seconds{15}));
    EXPECT_EQ(status()["state"], "tracking");
  }
  umount2(file("full").c_str(), MNT_DETACH);
}

TEST_F(LifeCycle, ControlShowsSavesResetsAndSwitches) {
  Child daemon(undisturbed(locusd(config())));
  ASSERT_TRUE(daemon.wait_for_line("DDS is up", seconds{10}));
  Child play(undisturbed({LOCUS_PLAY, capture().string()}));
  ASSERT_TRUE(status_comes([](const json& s) { return s["sweeps"]["processed"].get<int>() > 30; }, seconds{15}));

  const json status = this->status();
  for (const char* key :
       {"version", "config_sha256", "packets", "sweeps", "process_ms", "process_cpu_ms", "stage_ms", "points",
        "iterations_mean", "sources", "state", "age_ms", "rate_hz", "pose", "covariance", "observability", "lidars"})
    EXPECT_TRUE(status.contains(key)) << key;
  EXPECT_EQ(status["state"], "tracking");
  EXPECT_NEAR(status["rate_hz"].get<double>(), 10, 1);
  EXPECT_EQ(status["lidars"]["front"]["model"], "VLP-16");
  EXPECT_EQ(status["sources"]["imu"]["health"], "healthy");
  EXPECT_EQ(status["observability"].size(), 6U);
  EXPECT_EQ(status["covariance"].size(), 36U);

  const ProgramRun text = ctl({"status"});
  EXPECT_LE(lines_of(text.out).size(), 24U);
  for (const std::string& line : lines_of(text.out))
    EXPECT_LE(line.size(), 80U) << line;

  EXPECT_EQ(ctl({"flat-ground", "on"}).status, 0);
  EXPECT_EQ(this->status()["flat_ground"], "on");
  EXPECT_EQ(ctl({"flat-ground", "perhaps"}).status, 2);

  EXPECT_EQ(ctl({"save-map", file("map.pcd").string()}).status, 0);
  EXPECT_NE(read_text(file("map.pcd")).find("FIELDS x y z"), std::string::npos);

  EXPECT_EQ(ctl({"reset", "--pose", "100,50,0,0,0,90"}).status, 0);
  ASSERT_TRUE(status_comes([](const json& s) { return s["sweeps"]["processed"].get<int>() > 5; }, seconds{10}));
  EXPECT_NEAR(this->status()["pose"]["xyz_m"][0].get<double>(), 100, 5);
  EXPECT_NEAR(this->status()["pose"]["xyz_m"][1].get<double>(), 50, 5);

  const ProgramRun sensors = ctl({"sensors"});
  EXPECT_EQ(sensors.status, 0) << sensors.err;
  EXPECT_NE(sensors.out.find("VLP-16"), std::string::npos) << sensors.out;
  EXPECT_NE(sensors.out.find("port: 2368"), std::string::npos) << sensors.out;
}

TEST_F(LifeCycle, ControlWithoutAServiceSaysHowToStartOne) {
  const ProgramRun run = ctl({"status"});
  EXPECT_EQ(run.status, 1);
  EXPECT_NE(run.err.find("no service answers"), std::string::npos);
}

/// Packets come twenty times as fast as they were fired, by the sensor's own clock: 5 ms for each sweep, and it takes
/// as long as it can.
TEST_F(LifeCycle, OverloadDropsAndCountsAndMakesNothingOlder) {
  std::string text = read_text(config("segment_filter: {enabled: false}\nscan_to_scan: {mode: always}\nthreads: 1\n"));
  text.replace(text.find("{name: front,"), 13, "{name: front, time: sensor,");
  std::ofstream{file("overloaded.yaml")} << text;
  const Child daemon(undisturbed(locusd(file("overloaded.yaml"))));
  ASSERT_TRUE(daemon.wait_for_line("DDS is up", seconds{10}));
  play_to_end({"--speed", "20"});
  std::this_thread::sleep_for(seconds{1});
  const json status = this->status();
  const json& sweeps = status["sweeps"];
  EXPECT_NEAR(sweeps["seen"].get<int>(), 200, 2);
  EXPECT_EQ(sweeps["seen"].get<int>(),
            sweeps["processed"].get<int>() + sweeps["dropped"].get<int>() + sweeps["failed"].get<int>());
  EXPECT_GT(sweeps["dropped"].get<int>(), 20) << "else it was no overload";
  const auto of = [&](const char* figure, const char* share) { return status[figure][share].get<double>(); };
  constexpr double kPeriod_ms = 5;
  RecordProperty("dropped", sweeps["dropped"].get<int>());
  RecordProperty("process_p50_us", static_cast<int>(1e3 * of("process_ms", "p50")));
  RecordProperty("process_cpu_p50_us", static_cast<int>(1e3 * of("process_cpu_ms", "p50")));
  EXPECT_LT(of("process_ms", "p50"), kPeriod_ms + 1.2 * of("process_cpu_ms", "p50"));
  EXPECT_LT(of("process_ms", "max"), 200.0) << "a queue would be seconds long at the end";
}

TEST_F(LifeCycle, SocketsMayComeFromSystemd) {
  Child daemon({"/usr/bin/systemd-socket-activate", "--datagram", "--listen", "2368", "-E", "RUNTIME_DIRECTORY", "-E",
                "STATE_DIRECTORY", LOCUSD, "--config", config().string()});
  ASSERT_TRUE(daemon.wait_for_line("Listening on", seconds{3})) << testing::PrintToString(daemon.lines());
  Child play(undisturbed({LOCUS_PLAY, capture().string()}));
  EXPECT_TRUE(daemon.wait_for_line("tracking", seconds{15})) << testing::PrintToString(daemon.lines());
  const auto source_ip = [&] { return status()["lidars"]["front"]["source_ip"]; };
  for (int look = 0; look < 50 && source_ip().is_null(); ++look) // figures are gathered once a second
    std::this_thread::sleep_for(milliseconds{100});
  EXPECT_EQ(source_ip(), "127.0.0.1");
}

} // namespace
} // namespace locus::test
