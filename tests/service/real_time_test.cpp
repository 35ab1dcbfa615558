// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <chrono>
#include <csignal>
#include <fstream>
#include <map>
#include <memory>
#include <thread>

#include <sched.h>

#include "replay/synthetic_robot.hpp"
#include "service/robot_network.hpp"
#include "service/undisturbed.hpp"

namespace locus::test {
namespace {

using nlohmann::json;
using std::chrono::milliseconds;
using std::chrono::seconds;

class RealTime : public RobotNetwork {
 protected:
  static void play(const std::filesystem::path& folder) {
    Child play(undisturbed({LOCUS_PLAY, folder.string()}));
    EXPECT_EQ(play.wait_for_exit(seconds{60}), 0) << testing::PrintToString(play.lines());
  }
};

/// Of the threads of a process, by name: those that TBB makes for the odometry have its name, too.
std::multimap<std::string, int> fifo_priorities(pid_t process) {
  std::multimap<std::string, int> priorities;
  for (const auto& task : std::filesystem::directory_iterator("/proc/" + std::to_string(process) + "/task")) {
    std::string name;
    std::getline(std::ifstream{task.path() / "comm"}, name);
    const pid_t thread = std::stoi(task.path().filename().string());
    sched_param parameters{};
    sched_getparam(thread, &parameters);
    priorities.emplace(name, sched_getscheduler(thread) == SCHED_FIFO ? parameters.sched_priority : 0);
  }
  return priorities;
}

bool add_up(const json& sweeps) {
  return sweeps["seen"].get<int>() ==
         sweeps["processed"].get<int>() + sweeps["dropped"].get<int>() + sweeps["failed"].get<int>();
}

double median_ms(std::vector<Duration> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return 1e3 * to_seconds(*middle);
}

TEST_F(RealTime, PriorityIsThatOfIngestOdometryAndItsHelpers) {
  Child daemon(locusd(config("realtime: {priority: 7}\nthreads: 2\n")));
  ASSERT_TRUE(daemon.wait_for_line("DDS is up", seconds{10}));
  if (daemon.wait_for_line("realtime.priority was not granted", milliseconds{10}))
    GTEST_SKIP() << "real-time scheduling is not permitted here";
  Child play({LOCUS_PLAY, capture().string()});
  ASSERT_TRUE(daemon.wait_for_line("tracking", seconds{10}));
  std::this_thread::sleep_for(seconds{1});
  const auto priorities = fifo_priorities(daemon.pid());
  for (const auto& [name, priority] : priorities)
    EXPECT_EQ(priority, name == "ingest" || name == "odometry" ? 7 : 0) << name;
  EXPECT_EQ(priorities.count("ingest"), 1U);
  EXPECT_GE(priorities.count("odometry"), std::thread::hardware_concurrency() > 1 ? 2U : 1U) << "with a helper";
}

TEST_F(RealTime, WishesThatAreNotGrantedAreSaidAndCostNothing) {
  Child daemon(locusd(config("realtime: {cpus: [1000]}\n")));
  EXPECT_TRUE(daemon.wait_for_line("realtime.cpus was not granted", seconds{5}));
  EXPECT_TRUE(daemon.wait_for_line("DDS is up", seconds{10}));
}

/// From the instant that an estimate speaks of to a subscriber's hands. The sweep is closed by the packet after that
/// instant, which the lidar sends when it has fired it: up to 1.33 ms later, and as much to its end.
TEST_F(RealTime, EstimateIsInTheSubscribersHandsAMomentAfterItsSweep) {
  Child daemon(undisturbed(locusd(config())));
  Child listener(undisturbed({FAST_DDS_PEER, "0", "listen", "/locus"}));
  ASSERT_TRUE(daemon.wait_for_line("DDS is up", seconds{10}));
  std::this_thread::sleep_for(seconds{1});
  play(capture());
  std::vector<Duration> latencies;
  for (const HeardPose& pose : heard(listener))
    latencies.push_back(pose.heard - pose.stamp);
  ASSERT_GT(latencies.size(), 150U);
  latencies.resize(150); // the lidar's; at the end windows close in silence
  const json process_ms = status()["process_ms"];
  std::ranges::sort(latencies);
  RecordProperty("latency_p50_us", static_cast<int>(1e3 * median_ms(latencies)));
  RecordProperty("latency_p99_us", static_cast<int>(1e6 * to_seconds(latencies[148])));
  RecordProperty("process_p50_us", static_cast<int>(1e3 * process_ms["p50"].get<double>()));
  constexpr double kUntilThePacketCloses_ms = 2.66, kOnTheWay_ms = 1.5;
  EXPECT_LT(median_ms(latencies), process_ms["p50"].get<double>() + kUntilThePacketCloses_ms + kOnTheWay_ms);
}

TEST_F(RealTime, TwoLidarsImuAndOdometryOnOneCore) {
  const TemporaryFolder folder;
  write_room_drive(folder.path(), seconds{15}, 2);
  const std::filesystem::path file = this->file("two.yaml");
  std::ofstream{file} << read_text(folder / "config.yaml") << "realtime: {cpus: [0]}\n";
  Child daemon(locusd(file));
  ASSERT_TRUE(daemon.wait_for_line("DDS is up", seconds{10}));
  const json before = status();
  play(folder.path());
  const json after = status();
  EXPECT_EQ(after["packets"]["kernel_drops"], 0);
  EXPECT_EQ(after["packets"]["total"]["lost"], 0);
  EXPECT_TRUE(add_up(after["sweeps"])) << after["sweeps"];
  const double share = (after["cpu_s"].get<double>() - before["cpu_s"].get<double>()) /
                       (after["duration_s"].get<double>() - before["duration_s"].get<double>());
  RecordProperty("cpu_share_percent", static_cast<int>(100 * share));
  EXPECT_LT(share, 0.3);
}

/// Half of one core: what is too much is dropped and counted, what is processed is not older for it.
TEST_F(RealTime, OneCoreSharedWithABusyLoop) {
  Child daemon(locusd(config("realtime: {cpus: [0]}\n")));
  ASSERT_TRUE(daemon.wait_for_line("DDS is up", seconds{10}));
  const Child busy({"/usr/bin/taskset", "-c", "0", "/bin/sh", "-c", "while :; do :; done"});
  play(capture());
  const json status = this->status();
  EXPECT_TRUE(add_up(status["sweeps"])) << status["sweeps"];
  EXPECT_EQ(status["packets"]["kernel_drops"], 0);
  RecordProperty("dropped_of_200", status["sweeps"]["dropped"].get<int>());
  RecordProperty("oldest_us", static_cast<int>(1e3 * status["process_ms"]["max"].get<double>()));
  EXPECT_LT(status["process_ms"]["p50"].get<double>(), 100.0)
      << "an estimate is not older than a period when it is there";
}

} // namespace
} // namespace locus::test
