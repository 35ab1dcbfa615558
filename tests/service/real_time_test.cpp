// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <chrono>
#include <csignal>
#include <ctime>
#include <fstream>
#include <map>
#include <memory>
#include <set>
#include <thread>
#include <tuple>

#include <fmt/format.h>
#include <sched.h>

#include "daemon/machine_time.hpp"
#include "drivers/files/capture.hpp"
#include "service/robot_network.hpp"
#include "support/test_drives.hpp"

namespace locus::test {
namespace {

using nlohmann::json;
using std::chrono::milliseconds;
using std::chrono::seconds;

class RealTime : public RobotNetwork {
 protected:
  static void play(const std::filesystem::path& folder) {
    Child play({LOCUS_PLAY, folder.string()});
    EXPECT_EQ(play.wait_for_exit(), 0) << testing::PrintToString(play.lines());
  }
};

/// Returns the SCHED_FIFO priorities of a process' threads by name. TBB's workers of the odometry have its name, too.
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

Duration median(std::vector<Duration> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

double milliseconds_of(Duration duration) { return 1e3 * to_seconds(duration); }

/// Scheduling settings requested from the operating system.
class Scheduling : public RobotNetwork {};

TEST_F(Scheduling, PriorityAppliesToIngestOdometryAndHelpers) {
  Child daemon(locusd(config("realtime: {priority: 7}\nthreads: 2\n")));
  ASSERT_TRUE(daemon.wait_for_line("running with "));
  if (daemon.has_line("realtime.priority was not granted"))
    GTEST_SKIP() << "real-time scheduling is not permitted here";
  const Child play(endlessly(capture()));
  ASSERT_TRUE(daemon.wait_for_line("tracking"));
  const std::size_t odometry_threads = std::thread::hardware_concurrency() > 1 ? 2 : 1; // with one worker
  std::multimap<std::string, int> priorities;
  EXPECT_TRUE(comes_true([&] {
    priorities = fifo_priorities(daemon.pid());
    return priorities.count("odometry") >= odometry_threads;
  }));
  for (const auto& [name, priority] : priorities)
    EXPECT_EQ(priority, name == "ingest" || name == "odometry" ? 7 : 0) << name;
  EXPECT_EQ(priorities.count("ingest"), 1U);
}

TEST_F(Scheduling, DeniedRequestsAreReportedAndHarmless) {
  Child daemon(locusd(config("realtime: {cpus: [1000]}\n")));
  EXPECT_TRUE(daemon.wait_for_line("realtime.cpus was not granted"));
  EXPECT_TRUE(daemon.wait_for_line("DDS is up"));
}

TEST_F(Scheduling, ReloadMovesTheThreadsToOtherProcessorsAndBack) {
  const auto processors = [](pid_t process) {
    std::set<int> counts;
    for (const auto& task : std::filesystem::directory_iterator("/proc/" + std::to_string(process) + "/task")) {
      const pid_t thread = std::stoi(task.path().filename().string());
      std::string name;
      std::getline(std::ifstream(task.path() / "comm"), name);
      if (thread != process && name == "locusd")
        continue; // of a sanitizer: locusd names its threads
      cpu_set_t set;
      if (sched_getaffinity(thread, sizeof(set), &set) == 0)
        counts.insert(CPU_COUNT(&set));
    }
    return counts;
  };
  const Child daemon(locusd(config()));
  ASSERT_TRUE(daemon.wait_for_line("DDS is up"));
  const std::set<int> at_first = processors(daemon.pid());
  std::ignore = config(fmt::format("realtime: {{cpus: [{}]}}\n", first_processor()));
  ASSERT_EQ(ctl({"reload"}).status, 0);
  EXPECT_EQ(processors(daemon.pid()), std::set<int>{1});
  std::ignore = config();
  ASSERT_EQ(ctl({"reload"}).status, 0);
  EXPECT_EQ(processors(daemon.pid()), at_first);
}

/// Returns the firing times of the last returns of all packets, at which a lidar sends them.
std::vector<Stamp> sent_packets(const std::filesystem::path& folder) {
  std::vector<Stamp> sent;
  auto capture = Capture::open(folder / "lidar.pcap");
  while (const Datagram* const datagram = capture->next())
    if (datagram->destination_port == 2368)
      sent.push_back(datagram->receive_stamp);
  return sent;
}

/// Latency from the packet that closes a sweep, the first beyond its end, to the subscriber. The median over ten
/// sections of the drive counts, because other load on the machine may spoil some.
TEST_F(RealTime, EstimateReachesTheSubscriberShortlyAfterItsSweep) {
  Child daemon(locusd(config()));
  Child listener({FAST_DDS_PEER, "0", "listen", "/locus"});
  ASSERT_TRUE(hears_the_service(listener));
  Child lidar({LOCUS_PLAY, capture().string()});
  ASSERT_EQ(lidar.wait_for_exit(), 0) << testing::PrintToString(lidar.lines());

  constexpr Duration kJitter = std::chrono::microseconds{100}; // of arrivals; affects the sensor's clock estimate
  const std::vector<Stamp> sent = sent_packets(capture());
  const Duration shift = shift_of(lidar);
  std::vector<Duration> latencies;
  for (const HeardPose& pose : heard(listener)) {
    const auto closing = std::ranges::lower_bound(sent, pose.stamp - shift - kJitter);
    if (closing != sent.end())
      latencies.push_back(pose.heard - (*closing + shift));
  }
  constexpr std::size_t kStretches = 10, kSweeps = 15;
  ASSERT_GE(latencies.size(), kStretches * kSweeps);
  std::vector<Duration> medians;
  for (std::size_t i = 0; i < kStretches; ++i) {
    const auto begin = latencies.begin() + static_cast<std::ptrdiff_t>(i * kSweeps);
    medians.push_back(median({begin, begin + kSweeps}));
  }
  const double process_ms = status()["process_ms"]["p50"].get<double>();
  std::ranges::sort(latencies);
  RecordProperty("latency_p50_us", static_cast<int>(1e3 * milliseconds_of(median(medians))));
  RecordProperty("latency_p99_us", static_cast<int>(1e3 * milliseconds_of(latencies[latencies.size() * 99 / 100])));
  RecordProperty("process_p50_us", static_cast<int>(1e3 * process_ms));
  EXPECT_LT(milliseconds_of(median(medians)), process_ms + 1.5);
}

TEST_F(RealTime, TwoLidarsImuAndOdometryOnOneCore) {
  const TemporaryFolder folder;
  write_room_drive(folder.path(), seconds{15}, 2);
  const std::filesystem::path file = this->file("two.yaml");
  std::ofstream{file} << read_text(folder / "config.yaml")
                      << fmt::format("realtime: {{cpus: [{}]}}\n", first_processor());
  Child daemon(locusd(file));
  ASSERT_TRUE(daemon.wait_for_line("DDS is up"));
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

/// Worst overload: 1.5 s without any processing, while packets queue in the kernel. Two sweeps later every sweep is
/// processed again, without delay.
TEST_F(RealTime, RecoversTwoSweepsAfterAStall) {
  Child daemon(locusd(config()));
  Child listener({CYCLONE_PEER, "0", "listen", "/locus"});
  ASSERT_TRUE(hears_the_service(listener));
  Child lidar({LOCUS_PLAY, capture().string()});
  ASSERT_TRUE(daemon.wait_for_line("tracking"));
  std::this_thread::sleep_for(seconds{2});
  daemon.signal(SIGSTOP);
  std::this_thread::sleep_for(milliseconds{1500});
  daemon.signal(SIGCONT);
  const Stamp two_sweeps_later{daemon::read_clock(CLOCK_REALTIME) + milliseconds{200}};
  std::this_thread::sleep_for(seconds{3});
  std::vector<HeardPose> poses = heard(listener);
  std::erase_if(poses, [&](const HeardPose& pose) { return pose.stamp < two_sweeps_later; });
  ASSERT_GT(poses.size(), 20U);
  std::vector<Duration> ages;
  for (std::size_t i = 1; i < poses.size(); ++i) {
    EXPECT_LT(poses[i].stamp - poses[i - 1].stamp, milliseconds{150}) << "a sweep was dropped, " << i << " after it";
    ages.push_back(poses[i].heard - poses[i].stamp);
  }
  EXPECT_LT(median(ages), milliseconds{100});
  EXPECT_LT(ages.front(), milliseconds{200}) << "a period, and as much to process it";
  const json status = this->status();
  EXPECT_EQ(status["packets"]["kernel_drops"], 0);
  EXPECT_EQ(status["packets"]["total"]["lost"], 0);
}

/// Half of one core: excess sweeps are dropped and counted, and the processed ones are not delayed.
TEST_F(RealTime, OneCoreSharedWithABusyLoop) {
  const std::string processor = std::to_string(first_processor());
  Child daemon(locusd(config("realtime: {cpus: [" + processor + "]}\n")));
  ASSERT_TRUE(daemon.wait_for_line("DDS is up"));
  const Child busy({"/usr/bin/taskset", "-c", processor, "/bin/sh", "-c", "while :; do :; done"});
  play(capture());
  const json status = this->status();
  EXPECT_TRUE(add_up(status["sweeps"])) << status["sweeps"];
  EXPECT_EQ(status["packets"]["kernel_drops"], 0);
  RecordProperty("dropped_of_200", status["sweeps"]["dropped"].get<int>());
  RecordProperty("oldest_us", static_cast<int>(1e3 * status["process_ms"]["max"].get<double>()));
  EXPECT_LT(status["process_ms"]["p50"].get<double>(), 100.0)
      << "an estimate is not older than a period when it is there";
}

/// A loop of the same real-time priority yields the core once in 100 ms, and takes it back as soon as a thread of ours
/// blocks: most sweeps are dropped, all are counted, and the processed one is the newest.
TEST_F(RealTime, OneCoreSharedWithABusyLoopOfTheSameRealTimePriority) {
  const std::string processor = std::to_string(first_processor());
  Child daemon(locusd(config("realtime: {priority: 2, cpus: [" + processor + "]}\nthreads: 1\n")));
  ASSERT_TRUE(daemon.wait_for_line("DDS is up"));
  ASSERT_TRUE(daemon.wait_for_line("running with "));
  if (daemon.has_line("realtime.priority was not granted"))
    GTEST_SKIP() << "real-time scheduling is not permitted here";
  Child lidar({LOCUS_PLAY, capture().string()});
  ASSERT_TRUE(daemon.wait_for_line("tracking"));
  {
    const Child busy(
        {"/usr/bin/chrt", "--rr", "2", "/usr/bin/taskset", "-c", processor, "/bin/sh", "-c", "while :; do :; done"});
    std::this_thread::sleep_for(seconds{4});
  }
  std::this_thread::sleep_for(milliseconds{500});
  const json status = this->status();
  const json& sweeps = status["sweeps"];
  EXPECT_LE(sweeps["seen"].get<int>() - sweeps["processed"].get<int>() - sweeps["dropped"].get<int>() -
                sweeps["failed"].get<int>(),
            1)
      << sweeps;
  EXPECT_EQ(status["packets"]["kernel_drops"], 0);
  EXPECT_EQ(status["packets"]["total"]["lost"], 0);
  RecordProperty("dropped", sweeps["dropped"].get<int>());
  RecordProperty("oldest_us", static_cast<int>(1e3 * status["process_ms"]["max"].get<double>()));
  EXPECT_LT(status["process_ms"]["max"].get<double>(), 1000.0) << "four seconds, were there a queue";
}

} // namespace
} // namespace locus::test
