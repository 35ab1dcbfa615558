// SPDX-License-Identifier: Apache-2.0
#include "service/robot_network.hpp"

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <sstream>
#include <thread>

#include <fcntl.h>
#include <net/if.h>
#include <sched.h>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <unistd.h>

#include "drivers/files/capture.hpp"
#include "support/led_clock.hpp"
#include "support/test_drives.hpp"

namespace locus::test {
namespace {

bool bring_up(const char* interface) {
  const int any = ::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  ifreq request{};
  std::strncpy(request.ifr_name, interface, IFNAMSIZ - 1);
  bool up = ioctl(any, SIOCGIFFLAGS, &request) == 0;
  request.ifr_flags = static_cast<short>(request.ifr_flags | IFF_UP); // NOLINT(cppcoreguidelines-pro-type-union-access)
  up = up && ioctl(any, SIOCSIFFLAGS, &request) == 0;
  close(any);
  return up;
}

} // namespace

void RobotNetwork::SetUp() {
  if (unshare(CLONE_NEWNET) != 0 && unshare(CLONE_NEWUSER | CLONE_NEWNET) != 0)
    GTEST_SKIP() << "no network namespace of one's own: run as root, or allow user namespaces";
  ASSERT_TRUE(bring_up("lo"));
  use_runtime_folder(runtime_.path());
  setenv("STATE_DIRECTORY", folder_.path().c_str(), 1); // NOLINT(concurrency-mt-unsafe)
}

void RobotNetwork::use_runtime_folder(const std::filesystem::path& folder) {
  runtime_in_use_ = folder;
  setenv("RUNTIME_DIRECTORY", folder.c_str(), 1); // NOLINT(concurrency-mt-unsafe): no other thread yet
}

ProgramRun RobotNetwork::ctl(std::vector<std::string> words) const {
  words.insert(words.begin(), {"--socket", control().string()});
  return run_program(LOCUSCTL, words);
}

nlohmann::json RobotNetwork::status() const {
  const ProgramRun run = ctl({"status", "--json"});
  EXPECT_EQ(run.status, 0) << run.err;
  return nlohmann::json::parse(run.out, nullptr, false);
}

bool RobotNetwork::status_comes(const std::function<bool(const nlohmann::json&)>& holds) const {
  return comes_true([&] { return holds(status()); });
}

nlohmann::json RobotNetwork::status_when(const std::function<bool(const nlohmann::json&)>& holds) const {
  nlohmann::json last;
  const bool came = comes_true([&] { return holds(last = status()); });
  EXPECT_TRUE(came) << last;
  return last;
}

bool RobotNetwork::add_interfaces() {
  const auto run = [](const char* command) {
    return std::system(command) == 0;
  }; // NOLINT(concurrency-mt-unsafe, cert-env33-c)
  return run("ip link add robot0 type veth peer name robot1") && run("ip addr add 10.7.0.1/24 dev robot0") &&
         run("ip link set robot1 up") && run("ip link set robot0 up");
}

std::vector<std::string> RobotNetwork::endlessly(const std::filesystem::path& drive) {
  return {"/bin/sh", "-c", "while setpriv --pdeathsig KILL " LOCUS_PLAY " --quiet " + drive.string() + "; do :; done"};
}

std::filesystem::path RobotNetwork::capture() { return long_room_drive(); }

std::filesystem::path RobotNetwork::plant() { return plant_drive(); }

std::filesystem::path RobotNetwork::config(const std::string& more) const {
  std::filesystem::path path = file("locusd.yaml");
  std::ofstream{path} << read_text(capture() / "config.yaml") << more;
  return path;
}

std::filesystem::path RobotNetwork::lidar_with(const std::string& key_and_value) const {
  std::string text = read_text(capture() / "config.yaml");
  const std::string name = "name: front", key = key_and_value.substr(0, key_and_value.find(' '));
  if (const std::size_t at = text.find(key, text.find(name)); at != std::string::npos)
    text.replace(at, text.find_first_of(",}\n", at) - at, key_and_value);
  else
    text.replace(text.find(name), name.size(), name + ", " + key_and_value);
  std::ofstream{file("wrong.yaml")} << text;
  return file("wrong.yaml");
}

std::vector<std::string> RobotNetwork::led_locusd(const std::filesystem::path& config) const {
  std::ofstream{file("led_clock"), std::ios::binary} << std::string(sizeof(LedTime), '\0');
  return {"/usr/bin/env",
          std::string{"LD_PRELOAD="} + LED_CLOCK_LIBRARY,
          "LED_CLOCK=" + file("led_clock").string(),
          LOCUSD,
          "--config",
          config.string()};
}

std::vector<std::string> RobotNetwork::leading_play(std::vector<std::string> options) const {
  std::vector<std::string> command{"/usr/bin/env",
                                   std::string{"LD_PRELOAD="} + LED_CLOCK_LIBRARY,
                                   "LED_CLOCK=" + file("led_clock").string(),
                                   "LEADS_CLOCK=1",
                                   LOCUS_PLAY,
                                   "--lockstep",
                                   control().string()};
  command.insert(command.end(), options.begin(), options.end());
  return command;
}

LedTime& RobotNetwork::led_time() const {
  const int descriptor = open(file("led_clock").c_str(), O_RDWR | O_CLOEXEC);
  void* const page = mmap(nullptr, sizeof(LedTime), PROT_READ | PROT_WRITE, MAP_SHARED, descriptor, 0);
  EXPECT_NE(page, MAP_FAILED) << std::strerror(errno); // NOLINT(concurrency-mt-unsafe)
  close(descriptor);
  return *static_cast<LedTime*>(page);
}

bool RobotNetwork::is_held() const {
  const LedTime& time = led_time();
  return comes_true([&] { return time.held_at_ns == time.hold_at_ns; });
}

Duration patience_of_a_drive() { return 4 * patience(); }

bool comes_true(const std::function<bool()>& holds) {
  const auto give_up = std::chrono::steady_clock::now() + patience();
  while (std::chrono::steady_clock::now() < give_up) {
    if (holds())
      return true;
    std::this_thread::sleep_for(std::chrono::milliseconds{100});
  }
  return false;
}

bool hears_the_service(const Child& peer) {
  return peer.wait_for_line("matched odometry") && peer.wait_for_line("diagnostics ");
}

int first_processor() {
  cpu_set_t set;
  CPU_ZERO(&set);
  EXPECT_EQ(sched_getaffinity(0, sizeof(set), &set), 0);
  std::size_t processor = 0;
  while (processor < CPU_SETSIZE && !CPU_ISSET(processor, &set))
    ++processor;
  return static_cast<int>(processor);
}

std::uint64_t datagrams_in(const std::filesystem::path& file) {
  auto capture = Capture::open(file);
  std::uint64_t count = 0;
  while (capture && capture->next() != nullptr)
    ++count;
  return count;
}

Duration shift_of(const Child& play) {
  for (const std::string& line : play.lines())
    if (const std::size_t at = line.find("shifted by "); at != std::string::npos)
      return Duration{std::stoll(line.substr(at + 11))};
  ADD_FAILURE() << testing::PrintToString(play.lines());
  return {};
}

void expect_each_received(const std::vector<StampedPose>& replay, const std::vector<HeardPose>& heard, Duration shift,
                          const std::string& who) {
  double worst_m = 0, worst_deg = 0;
  for (const StampedPose& expected : replay) {
    const auto found = std::ranges::min_element(
        heard, {}, [&](const HeardPose& pose) { return std::chrono::abs(pose.stamp - shift - expected.stamp); });
    ASSERT_NE(found, heard.end());
    ASSERT_LT(std::chrono::abs(found->stamp - shift - expected.stamp), std::chrono::milliseconds{2})
        << who << " missed a sweep";
    const Pose error = expected.T_source_base.inverse() * found->T_odom_base;
    worst_m = std::max(worst_m, error.translation.norm());
    worst_deg = std::max(worst_deg, angle_rad(error.rotation) / kRadPerDeg);
  }
  EXPECT_LT(worst_m, 0.01) << who;
  EXPECT_LT(worst_deg, 0.1) << who;
  testing::Test::RecordProperty(who + "_worst_um", static_cast<int>(1e6 * worst_m));
  testing::Test::RecordProperty(who + "_worst_mdeg", static_cast<int>(1e3 * worst_deg));
}

double worst_distance_m(const std::vector<StampedPose>& expected, const std::vector<HeardPose>& heard, Duration shift) {
  double worst_m = 0;
  int compared = 0;
  for (const HeardPose& pose : heard) {
    const Stamp stamp = pose.stamp - shift;
    const auto after = std::ranges::upper_bound(expected, stamp, {}, &StampedPose::stamp);
    if (after == expected.begin() || after == expected.end())
      continue;
    const StampedPose& before = *std::prev(after);
    const double share = to_seconds(stamp - before.stamp) / to_seconds(after->stamp - before.stamp);
    const Pose T_odom_base = interpolate(before.T_source_base, after->T_source_base, share);
    worst_m = std::max(worst_m, (T_odom_base.translation - pose.T_odom_base.translation).norm());
    ++compared;
  }
  EXPECT_GT(compared, 20) << "of " << heard.size() << " that were heard";
  return worst_m;
}

std::vector<HeardPose> heard(const Child& peer, const std::string& topic) {
  std::vector<HeardPose> poses;
  for (const std::string& line : peer.lines_of(topic)) {
    std::istringstream row{line};
    std::array<double, 7> v{};
    std::int64_t seconds = 0, nanoseconds = 0, heard_ns = 0;
    char dot = 0;
    std::string frame, child, yaw_variance, yaw_rate;
    row >> seconds >> dot >> nanoseconds;
    for (double& value : v)
      row >> value;
    row >> frame >> child >> yaw_variance >> yaw_rate >> heard_ns;
    poses.push_back({stamp_from_ns(seconds * 1'000'000'000 + nanoseconds),
                     {Eigen::Quaterniond(v[6], v[3], v[4], v[5]).normalized(), {v[0], v[1], v[2]}},
                     stamp_from_ns(heard_ns)});
  }
  return poses;
}

} // namespace locus::test
