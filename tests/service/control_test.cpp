// SPDX-License-Identifier: Apache-2.0
#include <array>
#include <atomic>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <functional>
#include <sstream>
#include <string>
#include <string_view>
#include <thread>
#include <utility>
#include <vector>

#include <poll.h>
#include <sched.h>
#include <sys/mount.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/un.h>
#include <unistd.h>

#include "drivers/velodyne/position_packet.hpp"
#include "service/robot_network.hpp"
#include "service/terminal.hpp"
#include "support/udp_sender.hpp"

namespace locus::test {
namespace {

class Control : public RobotNetwork {
 protected:
  [[nodiscard]] std::vector<std::string> watch() const {
    return {LOCUSCTL, "--socket", control().string(), "status", "--watch"};
  }

  /// Returns the CPU time of the service during `meanwhile`, as a fraction of a core.
  [[nodiscard]] double cpu_share(const std::function<void()>& meanwhile) const {
    const nlohmann::json before = status();
    meanwhile();
    const nlohmann::json after = status();
    const auto grown_s = [&](const char* key) { return after[key].get<double>() - before[key].get<double>(); };
    return grown_s("cpu_s") / grown_s("duration_s");
  }

  /// Runs locusctl as a user that is neither root nor in the service's group.
  [[nodiscard]] ProgramRun as_stranger(std::vector<std::string> words) const {
    words.insert(words.begin(), {"--socket", control().string()});
    return as_nobody("--clear-groups", words);
  }

  [[nodiscard]] ProgramRun as_nobody(const std::string& groups, std::vector<std::string> words) const {
    const std::filesystem::path locusctl = file("locusctl"); // executable for every user
    if (!std::filesystem::exists(locusctl))
      std::filesystem::copy_file(LOCUSCTL, locusctl);
    chmod(locusctl.parent_path().c_str(), 0755);
    chmod(control().parent_path().c_str(), 0755);
    words.insert(words.begin(), {"--reuid=65534", "--regid=65534", groups, locusctl.string()});
    return run_program("/usr/bin/setpriv", words);
  }
};

bool same(const termios& a, const termios& b) {
  return a.c_iflag == b.c_iflag && a.c_oflag == b.c_oflag && a.c_cflag == b.c_cflag && a.c_lflag == b.c_lflag &&
         std::memcmp(a.c_cc, b.c_cc, sizeof(a.c_cc)) == 0;
}

/// Watches until `ends` is typed, and expects the terminal settings to be restored.
void expect_watch_ends(const std::vector<std::string>& command, const std::string& ends) {
  Terminal terminal(command);
  ASSERT_TRUE(terminal.shows("sweeps"));
  EXPECT_TRUE(terminal.on_page_of_its_own());
  EXPECT_FALSE(terminal.cursor_is_shown());
  const int pages = terminal.pages();
  EXPECT_TRUE(terminal.wait_until([&] { return terminal.pages() >= pages + 2; })) << "it is drawn again";
  terminal.type(ends);
  EXPECT_EQ(terminal.wait_for_exit(), 0);
  EXPECT_FALSE(terminal.on_page_of_its_own());
  EXPECT_TRUE(terminal.cursor_is_shown());
  EXPECT_TRUE(same(terminal.settings(), terminal.settings_before()));
  EXPECT_EQ(terminal.overflows(), 0);
}

TEST_F(Control, WatchFillsATerminalOf80By24AndRestoresIt) {
  Child daemon(locusd(config()));
  ASSERT_TRUE(daemon.wait_for_line("DDS is up"));
  const Child play(endlessly(capture()));
  ASSERT_TRUE(daemon.wait_for_line("tracking"));
  expect_watch_ends(watch(), "q");
  expect_watch_ends(watch(), "\x03");
}

TEST_F(Control, WatchContinuesWithoutTheService) {
  Child daemon(locusd(config()));
  ASSERT_TRUE(daemon.wait_for_line("DDS is up"));
  Terminal terminal(watch());
  ASSERT_TRUE(terminal.shows("waiting"));
  daemon.signal(SIGTERM);
  ASSERT_EQ(daemon.wait_for_exit(), 0);
  EXPECT_TRUE(terminal.shows("no service answers"));
  const Child again(locusd(config()));
  EXPECT_TRUE(terminal.shows("waiting"));
}

TEST_F(Control, WatchWithoutATerminalIsWrongUsage) {
  const ProgramRun run = ctl({"status", "--watch"});
  EXPECT_EQ(run.status, 2);
  EXPECT_NE(run.err.find("--watch needs a terminal"), std::string::npos) << run.err;
  EXPECT_EQ(run.out, "");
}

TEST_F(Control, StatusShowsSensorsThatWereNeverReceived) {
  Child daemon(locusd(config()));
  ASSERT_TRUE(daemon.wait_for_line("DDS is up"));
  EXPECT_TRUE(status()["lidars"].front()["heard_ms_ago"].is_null());
  EXPECT_NE(ctl({"status"}).out.find("always"), std::string::npos);
}

TEST_F(Control, StatusColumnsAreStableWhileALidarSynchronises) {
  Child daemon(locusd(config()));
  ASSERT_TRUE(daemon.wait_for_line("DDS is up"));
  std::vector<std::byte> packet(velodyne::kPositionPacketBytes);
  packet[0xCA] = std::byte{1}; // PPS
  UdpSender().send(8308, packet);
  ASSERT_TRUE(status_comes([](const auto& status) { return status["lidars"]["front"]["pps"] == "synchronizing"; }));
  std::istringstream lines(ctl({"status"}).out);
  bool said = false;
  for (std::string line; std::getline(lines, line);) {
    EXPECT_LE(line.size(), 80U) << line;
    said = said || (line.starts_with("front") && line.ends_with(" synchron"));
  }
  EXPECT_TRUE(said);
}

TEST_F(Control, UnprivilegedUsersMayOnlyQueryTheStatus) {
  if (geteuid() != 0)
    GTEST_SKIP() << "no second user to be: run as root";
  Child daemon(locusd(config()));
  ASSERT_TRUE(daemon.wait_for_line("DDS is up"));
  const ProgramRun look = as_stranger({"status", "--json"});
  EXPECT_EQ(look.status, 0) << look.err;
  EXPECT_NE(look.out.find("\"waiting\""), std::string::npos);
  using Words = std::vector<std::string>;
  for (const Words& command :
       {Words{"reset"}, Words{"reload"}, Words{"flat-ground", "on"}, Words{"save-map", "/dev/null"}}) {
    const ProgramRun touch = as_stranger(command);
    EXPECT_EQ(touch.status, 1) << command.front();
    EXPECT_EQ(touch.err, "locusctl: not permitted; be root or a member of group locusd\n") << command.front();
  }
  EXPECT_EQ(status()["flat_ground"], "off");
}

/// A hostile local client without privileges.
class Pest {
 public:
  Pest(std::string path, bool speaks) : path_(std::move(path)), speaks_(speaks) {
    for (std::thread& thread : threads_)
      thread = std::thread([this] { run(); });
  }
  ~Pest() {
    stopping_ = true;
    for (std::thread& thread : threads_)
      thread.join();
  }
  Pest(const Pest&) = delete;
  Pest& operator=(const Pest&) = delete;

  [[nodiscard]] int answers() const { return answers_; }
  /// Returns the rate of successful connections, accepted or queued.
  [[nodiscard]] double calls_per_s() const {
    const std::chrono::duration<double> elapsed = std::chrono::steady_clock::now() - begin_;
    return calls_ / elapsed.count();
  }

 private:
  /// Opens new connections all the time and keeps the last hundred silent ones open. Sends requests if `speaks_`.
  void run() {
    constexpr int kNobody = 65534;
    syscall(SYS_setgroups, 0, nullptr); // this thread only
    syscall(SYS_setresuid, kNobody, kNobody, kNobody);
    const auto call = [&] {
      const int socket = ::socket(AF_UNIX, SOCK_SEQPACKET | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
      sockaddr_un address{AF_UNIX, {}};
      path_.copy(address.sun_path, sizeof(address.sun_path) - 1);
      if (connect(socket, reinterpret_cast<const sockaddr*>(&address), sizeof(address)) == 0)
        ++calls_;
      return socket;
    };
    std::array<int, 100> silent{};
    for (std::size_t i = 0; !stopping_; ++i) {
      int& idle = silent[i % silent.size()];
      if (idle > 0)
        close(idle);
      idle = call();
      if (!speaks_) { // 10 000 times a second by all threads, without occupying the processors
        std::this_thread::sleep_for(std::chrono::microseconds{300});
        continue;
      }
      const int socket = call();
      constexpr std::string_view kAsk = R"({"command": "status"})", kReset = R"({"command": "reset"})";
      for (const std::string_view request : {kAsk, kReset, kAsk.substr(1), std::string_view{}}) {
        pollfd answer{socket, POLLIN, 0};
        if (::send(socket, request.data(), request.size(), MSG_NOSIGNAL) >= 0 && poll(&answer, 1, 20) > 0)
          ++answers_;
      }
      close(socket);
    }
    for (const int idle : silent)
      if (idle > 0)
        close(idle);
  }

  std::string path_;
  bool speaks_;
  std::atomic<bool> stopping_{false};
  std::atomic<int> answers_{0}, calls_{0};
  std::chrono::steady_clock::time_point begin_ = std::chrono::steady_clock::now();
  std::array<std::thread, 4> threads_;
};

TEST_F(Control, UnprivilegedRequestFloodBlocksNoPrivilegedClient) {
  if (geteuid() != 0)
    GTEST_SKIP() << "no second user to be: run as root";
  const Child daemon(locusd(config()));
  ASSERT_TRUE(daemon.wait_for_line("DDS is up"));
  chmod(control().parent_path().c_str(), 0755);
  for (const bool speaks : {true, false}) {
    const Pest pest(control().string(), speaks);
    EXPECT_TRUE(status_comes([&](const nlohmann::json& status) {
      return status["state"] == "waiting" && (!speaks || pest.answers() > 50);
    })) << "they are answered, too";
    for (const char* mode : {"on", "off"}) {
      EXPECT_EQ(ctl({"flat-ground", mode}).status, 0);
      EXPECT_EQ(status()["flat_ground"], mode);
    }
  }
}

/// The cost of strangers is compared with that of the odometry on the same machine. Their rate is bounded by time, and
/// holds on any machine.
TEST_F(Control, UnprivilegedRequestFloodCostsLittle) {
  if (geteuid() != 0)
    GTEST_SKIP() << "no second user to be: run as root";
  Child daemon(locusd(config()));
  ASSERT_TRUE(daemon.wait_for_line("DDS is up"));
  Child play({LOCUS_PLAY, capture().string()});
  ASSERT_TRUE(daemon.wait_for_line("tracking"));
  chmod(control().parent_path().c_str(), 0755);
  constexpr std::chrono::seconds kWhile{3}; // measured three times within the twenty seconds of the drive
  const double alone = cpu_share([&] { std::this_thread::sleep_for(kWhile); });
  RecordProperty("cpu_share_alone", std::to_string(alone));
  for (const bool speaks : {true, false}) {
    double calls_per_s = 0.0;
    const double share = cpu_share([&] {
      const Pest pest(control().string(), speaks);
      std::this_thread::sleep_for(kWhile);
      EXPECT_TRUE(!speaks || pest.answers() > 50);
      calls_per_s = pest.calls_per_s();
    });
    const std::string who = speaks ? "_speaking" : "_silent";
    RecordProperty("calls_per_s" + who, std::to_string(calls_per_s));
    RecordProperty("cpu_share" + who, std::to_string(share));
    EXPECT_LT(calls_per_s, 400.0) << "sixteen at a time, twenty times a second";
    EXPECT_LT(share, 2.5 * alone) << who << ", the odometry's share included";
  }
  const nlohmann::json after = status();
  EXPECT_EQ(after["state"], "tracking");
  EXPECT_EQ(after["packets"]["total"]["lost"], 0);
  EXPECT_EQ(after["sweeps"]["dropped"], 0);
}

/// The service is a named instance, and its group exists only in this test.
TEST_F(Control, GroupMembersControlAnInstanceByItsName) {
  if (unshare(CLONE_NEWNS) != 0 || mount("none", "/", nullptr, MS_REC | MS_PRIVATE, nullptr) != 0 ||
      mount("tmpfs", "/run", "tmpfs", 0, nullptr) != 0)
    GTEST_SKIP() << "no file system of one's own: run as root";
  std::ofstream{file("group")} << "root:x:0:\nlocusd:x:4242:\n";
  ASSERT_EQ(mount(file("group").c_str(), "/etc/group", nullptr, MS_BIND, nullptr), 0);
  setenv("RUNTIME_DIRECTORY", "/run/locusd@left", 1); // NOLINT(concurrency-mt-unsafe)
  {
    const Child daemon(locusd(config()));
    ASSERT_TRUE(daemon.wait_for_line("DDS is up"));
    const ProgramRun member = as_nobody("--groups=4242", {"--instance", "left", "flat-ground", "on"});
    EXPECT_EQ(member.status, 0) << member.err;
    EXPECT_NE(run_program(LOCUSCTL, {"--instance", "left", "status", "--json"}).out.find("\"flat_ground\": \"on\""),
              std::string::npos);
    EXPECT_EQ(as_nobody("--groups=4243", {"--instance", "left", "flat-ground", "off"}).status, 1);
    const ProgramRun other = run_program(LOCUSCTL, {"--instance", "right", "status"});
    EXPECT_EQ(other.status, 1);
    EXPECT_NE(other.err.find("/run/locusd@right/control"), std::string::npos) << other.err;
  }
  umount2("/etc/group", MNT_DETACH);
  umount2("/run", MNT_DETACH);
}

TEST_F(Control, SensorsNeedsNeitherServiceNorPrivilege) {
  if (geteuid() != 0)
    GTEST_SKIP() << "no second user to be: run as root";
  const Child play(endlessly(capture()));
  ASSERT_TRUE(play.wait_for_line("has no subscriber")) << "it waits for a service, and then sends";
  const ProgramRun sensors = as_nobody("--clear-groups", {"sensors"});
  EXPECT_EQ(sensors.status, 0) << sensors.err;
  EXPECT_NE(sensors.out.find("127.0.0.1"), std::string::npos) << sensors.out;
  EXPECT_NE(sensors.out.find("    model: VLP-16  # by its packets\n    port: 2368"), std::string::npos) << sensors.out;
}

/// A stand-in for a service whose disk is slower than the timeout of a status request.
TEST_F(Control, DiskBoundRequestsHaveALongerTimeout) {
  std::filesystem::create_directories(control().parent_path());
  const int service = ::socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0);
  sockaddr_un address{AF_UNIX, {}};
  control().native().copy(address.sun_path, sizeof(address.sun_path) - 1);
  ASSERT_EQ(bind(service, reinterpret_cast<const sockaddr*>(&address), sizeof(address)), 0);
  ASSERT_EQ(listen(service, 2), 0);
  Child reload({LOCUSCTL, "--socket", control().string(), "reload"});
  const int client = accept4(service, nullptr, nullptr, SOCK_CLOEXEC);
  const ProgramRun status = ctl({"status"});
  EXPECT_EQ(status.status, 1);
  EXPECT_NE(status.err.find("the service does not answer"), std::string::npos) << status.err;
  constexpr std::string_view kDone = R"({"done": true})";
  EXPECT_EQ(::send(client, kDone.data(), kDone.size(), MSG_NOSIGNAL), static_cast<ssize_t>(kDone.size()));
  EXPECT_EQ(reload.wait_for_exit(), 0) << testing::PrintToString(reload.lines());
  close(client);
  close(service);
}

TEST_F(Control, MistypedWordsSuggestTheNearest) {
  const auto refused = [](const ProgramRun& run, const std::string& words) {
    EXPECT_EQ(run.status, 2) << run.err;
    EXPECT_NE(run.err.find(words), std::string::npos) << run.err;
    EXPECT_EQ(lines_of(run.err).size(), 1U) << run.err;
  };
  refused(ctl({"statsu"}), "there is no command statsu; the nearest is status");
  refused(ctl({"status", "--jsno"}), "there is no option --jsno; the nearest is --json");
  refused(ctl({"--instnace=front", "status"}), "there is no option --instnace; the nearest is --instance");
  refused(run_program(LOCUSD, {"--chek-config"}), "there is no option --chek-config; the nearest is --check-config");
  refused(run_program(LOCUS_PLAY, {"--sped", "2", "drive"}), "there is no option --sped; the nearest is --speed");
  std::ofstream{file("bad.yaml")} << "dds:\n  domian: 3\n";
  refused(run_program(LOCUSD, {"--config", file("bad.yaml").string(), "--check-config"}), "'domain'");
}

} // namespace
} // namespace locus::test
