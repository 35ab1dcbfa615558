// SPDX-License-Identifier: Apache-2.0
// Floods on the robot's networks.
#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <cstdlib>
#include <fstream>
#include <memory>
#include <random>
#include <thread>

#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include "service/robot_network.hpp"

namespace locus::test {
namespace {

using nlohmann::json;
using std::chrono::milliseconds;
using std::chrono::seconds;

/// Sends garbage to the lidar ports from another address at the maximum rate, on its own thread.
class UdpFlood {
 public:
  UdpFlood() : thread_([this] { run(); }) {}
  ~UdpFlood() { stop(); }
  UdpFlood(const UdpFlood&) = delete;
  UdpFlood& operator=(const UdpFlood&) = delete;

  /// Stops the thread; returns the number of datagrams sent.
  std::uint64_t stop() {
    stopping_ = true;
    if (thread_.joinable())
      thread_.join();
    return sent_;
  }

 private:
  void run() {
    const int socket = ::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
    const sockaddr_in from{AF_INET, 0, {htonl(INADDR_LOOPBACK + 1)}, {}};
    EXPECT_EQ(bind(socket, reinterpret_cast<const sockaddr*>(&from), sizeof(from)), 0);
    constexpr std::size_t kBatch = 64;
    std::array<std::byte, 1400> garbage{};
    std::minstd_rand random(1);
    std::ranges::generate(garbage, [&] { return static_cast<std::byte>(random()); });
    const std::array<std::size_t, 4> lengths{1206, 512, 1400, 0};
    std::array<sockaddr_in, kBatch> to{};
    std::array<iovec, kBatch> vectors{};
    std::array<mmsghdr, kBatch> messages{};
    for (std::size_t i = 0; i < kBatch; ++i) {
      to[i] = {AF_INET, htons(i % 8 == 0 ? 8308 : 2368), {htonl(INADDR_LOOPBACK)}, {}};
      vectors[i] = {garbage.data(), lengths[i % lengths.size()]};
      messages[i].msg_hdr = {&to[i], sizeof(sockaddr_in), &vectors[i], 1, nullptr, 0, 0};
    }
    while (!stopping_)
      if (const int count = sendmmsg(socket, messages.data(), kBatch, 0); count > 0)
        sent_ += static_cast<std::uint64_t>(count);
    close(socket);
  }

  std::atomic<bool> stopping_{false};
  std::uint64_t sent_ = 0;
  std::thread thread_;
};

class Flood : public RobotNetwork {
 protected:
  /// Records a named figure of the flood.
  void record(const char* name, double value) const { RecordProperty(name, std::to_string(value)); }
};

std::uint64_t sum(const json& counts) {
  std::uint64_t total = 0;
  for (const auto& [reason, count] : counts.items())
    total += count.get<std::uint64_t>();
  return total;
}

std::uint64_t sum_but_stale(json counts) {
  counts.erase("stale");
  return sum(counts);
}

/// Every datagram of lidar and flood is accounted for: decoded, rejected with a reason, or filtered by the kernel.
TEST_F(Flood, GarbageOnTheLidarPortsLosesNoLidarPacket) {
  Child daemon(locusd(config()));
  ASSERT_TRUE(daemon.wait_for_line("DDS is up"));
  Child play({LOCUS_PLAY, capture().string()});
  ASSERT_TRUE(daemon.wait_for_line("tracking"));
  const json before = status();
  std::uint64_t garbage = 0;
  constexpr double kFlood_s = 8;
  {
    UdpFlood flood;
    std::this_thread::sleep_for(from_seconds(kFlood_s));
    garbage = flood.stop();
  }
  const json after = status();
  ASSERT_EQ(play.wait_for_exit(), 0) << testing::PrintToString(play.lines());
  std::this_thread::sleep_for(milliseconds{500});

  const json end = status(), total = end["packets"]["total"];
  const auto lidar = datagrams_in(capture() / "lidar.pcap");
  const auto filtered = end["dropped"]["flood_datagrams"].get<std::uint64_t>();
  EXPECT_GT(garbage, kFlood_s * 20'000) << "else it was no flood";
  EXPECT_EQ(total["lost"], 0);
  EXPECT_EQ(end["packets"]["kernel_drops"], 0);
  EXPECT_EQ(total["data"].get<std::uint64_t>() + total["position"].get<std::uint64_t>(), lidar);
  EXPECT_EQ(sum(total["rejected"]) + filtered, garbage);
  EXPECT_GT(filtered, garbage * 9 / 10);
  EXPECT_GT(total["rejected"]["sender"], 100);
  EXPECT_EQ(end["sweeps"]["dropped"], 0);
  const double cpu_share = (after["cpu_s"].get<double>() - before["cpu_s"].get<double>()) / kFlood_s;
  EXPECT_LT(cpu_share, 0.5) << "of a core, the odometry's share included";
  EXPECT_TRUE(daemon.has_line("the ports of the lidars are flooded"));
  record("garbage_per_s", static_cast<double>(garbage) / kFlood_s);
  record("cpu_share", cpu_share);
}

/// DDS inputs belong to their first publisher. Data of a source that had no publisher before is validated.
class DdsFlood : public Flood {
 protected:
  /// Limits the quarantine of AddressSanitizer, which retains freed memory: the test measures memory.
  DdsFlood() {
    setenv("ASAN_OPTIONS", "quarantine_size_mb=8", 1); // NOLINT(concurrency-mt-unsafe): before the programs are started
  }

  static std::vector<std::string> peer(const char* role) { return {CYCLONE_PEER, "0", role, "/locus"}; }

  [[nodiscard]] std::filesystem::path with_health_topic() const {
    std::string text = read_text(config());
    const std::string topic = "topic: /wheel_odometry";
    EXPECT_NE(text.find(topic), std::string::npos) << text;
    text.replace(text.find(topic), topic.size(), topic + ", health_topic: /wheel_health");
    std::ofstream{file("health.yaml")} << text;
    return file("health.yaml");
  }
};

/// The flood can occupy both cores, so that a source may be silent for a moment; none of its samples may be rejected
/// because of the flood.
TEST_F(DdsFlood, BesideTheSensorsChangesOnlyACounter) {
  const Replay replay({"--quiet", capture().string()});
  ASSERT_EQ(replay.run().status, 0) << replay.run().err;
  Child daemon(locusd(config("flat_ground: off\ndds: {flat_ground_topic: /flat_ground}\n")));
  const Child mistyped(peer("mistype"));
  const Child commander(peer("command"));
  Child listener(peer("listen"));
  ASSERT_TRUE(hears_the_service(listener));
  Child play({LOCUS_PLAY, capture().string()});
  ASSERT_TRUE(daemon.wait_for_line("tracking"));
  std::this_thread::sleep_for(seconds{1});
  const json before = status();
  Child flood(peer("flood"));
  std::this_thread::sleep_for(seconds{8});
  const json after = status();
  const auto healthy = [](const json& source) { return source["health"] == "healthy"; };
  EXPECT_TRUE(status_comes([&](const json& s) { return std::ranges::all_of(s["sources"], healthy); }));
  flood.close_stdin();
  EXPECT_EQ(flood.wait_for_exit(), 0) << testing::PrintToString(flood.lines());
  ASSERT_EQ(play.wait_for_exit(), 0) << testing::PrintToString(play.lines());

  for (const char* name : {"wio", "imu"}) {
    const json& source = after["sources"][name];
    EXPECT_GT(source["refused"], 1000) << source;
    EXPECT_EQ(sum_but_stale(source["rejected"]), sum_but_stale(before["sources"][name]["rejected"])) << source;
    EXPECT_EQ(source["writers"], 2) << "what has another type is none";
    record((std::string(name) + "_refused").c_str(), source["refused"].get<double>());
  }
  EXPECT_TRUE(daemon.has_line("a second publisher"));
  EXPECT_GT(after["dropped"]["flat_ground_messages"], 100);
  EXPECT_FALSE(daemon.has_line("flat ground turned on")) << "as the flood says";
  EXPECT_LT(worst_distance_m(replay.trajectory(), heard(listener), shift_of(play)), 0.05);
  EXPECT_LT(after["peak_rss_mb"].get<double>(), before["peak_rss_mb"].get<double>() + 50);
  const double elapsed_s = after["duration_s"].get<double>() - before["duration_s"].get<double>();
  const double cpu_share = (after["cpu_s"].get<double>() - before["cpu_s"].get<double>()) / elapsed_s;
  record("cpu_share", cpu_share);
  EXPECT_LT(cpu_share, 1.6) << "cores: that of the DDS library, and that of its reader";
  EXPECT_EQ(after["sweeps"]["dropped"], 0);
}

/// The flood is the first publisher of these topics and becomes the source; lidar carries the odometry.
TEST_F(DdsFlood, AsTheOnlySourceIsRejectedAndLidarContinues) {
  Child daemon(locusd(with_health_topic()));
  ASSERT_TRUE(daemon.wait_for_line("DDS is up"));
  Child flood(peer("flood"));
  ASSERT_TRUE(status_comes([](const json& s) { return s["sources"]["imu"]["received"] > 1000; }));
  auto play = std::make_unique<Child>(std::vector<std::string>{LOCUS_PLAY, capture().string()});
  ASSERT_TRUE(daemon.wait_for_line("tracking"));
  const json before = status();
  std::this_thread::sleep_for(seconds{6});
  const json after = status();
  EXPECT_EQ(after["state"], "tracking");
  EXPECT_EQ(after["packets"]["total"]["lost"], 0);
  EXPECT_GT(after["sweeps"]["processed"].get<int>() - before["sweeps"]["processed"].get<int>(), 50);
  for (const char* name : {"wio", "imu"}) {
    EXPECT_NE(after["sources"][name]["health"], "healthy") << after["sources"][name];
    EXPECT_GT(sum(after["sources"][name]["rejected"]), 1000);
  }
  EXPECT_LT(after["peak_rss_mb"].get<double>(), before["peak_rss_mb"].get<double>() + 50);
  record("motion_drops", after["dropped"]["motion_samples"].get<double>());
  record("cpu_share", (after["cpu_s"].get<double>() - before["cpu_s"].get<double>()) / 6);
  // An ended publisher frees the topic for the next one. The sensors start only now, because the flood would prevent
  // their discovery.
  flood.close_stdin();
  ASSERT_EQ(flood.wait_for_exit(), 0) << testing::PrintToString(flood.lines());
  play.reset();
  const Child sensors({LOCUS_PLAY, capture().string()});
  EXPECT_TRUE(status_comes([](const json& s) { return s["sources"]["imu"]["health"] == "healthy"; }))
      << status()["sources"];
}

} // namespace
} // namespace locus::test
