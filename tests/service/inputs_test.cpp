// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <chrono>
#include <csignal>
#include <cstdint>
#include <map>
#include <random>
#include <string>
#include <vector>

#include "daemon/service/machine.hpp"
#include "service/robot_network.hpp"
#include "support/udp_sender.hpp"

namespace locus::test {
namespace {

using nlohmann::json;
using std::chrono::seconds;

TEST(LidarPorts, AreThoseOfTheMakers) {
  using Ports = std::map<std::uint16_t, bool>;
  Config config;
  EXPECT_EQ(daemon::lidar_ports(config), (Ports{{2368, true}, {8308, false}}));
  LidarOptions& lidar = config.lidars.front();
  lidar.port = 2400;
  EXPECT_EQ(daemon::lidar_ports(config), (Ports{{2400, true}, {8308, false}, {8340, false}}));
  lidar.ouster = true;
  lidar.port = 7502;
  lidar.imu_port = 7503;
  EXPECT_EQ(daemon::lidar_ports(config), (Ports{{7502, true}, {7503, false}})) << "it sends no position packets";
  lidar.topic = "/points";
  EXPECT_EQ(daemon::lidar_ports(config), Ports{});
}

class Inputs : public RobotNetwork {};

TEST_F(Inputs, GarbageOnTheNetworkIsCountedAndHarmless) {
  Child daemon(locusd(config()));
  ASSERT_TRUE(daemon.wait_for_line("DDS is up"));
  const UdpSender sender;
  std::minstd_rand random(1);
  constexpr int kDatagrams = 3000;
  for (int i = 0; i < kDatagrams; ++i) {
    const std::array<std::size_t, 7> sizes{0, 1, 512, 1206, 1206, 1400, random() % 1500};
    std::vector<std::byte> payload(sizes[random() % sizes.size()]);
    std::ranges::generate(payload, [&] { return static_cast<std::byte>(random()); });
    sender.send(i % 3 == 0 ? 8308 : 2368, payload);
    if (i % 100 == 99) { // fits the smallest socket buffer
      ASSERT_TRUE(status_comes([&](const json& status) { return status["packets"]["total"]["received"] == i + 1; }));
    }
  }
  const json total = status()["packets"]["total"];
  std::uint64_t rejected = 0;
  for (const auto& [reason, count] : total["rejected"].items())
    rejected += count.get<std::uint64_t>();
  EXPECT_EQ(total["received"].get<std::uint64_t>(), kDatagrams);
  EXPECT_EQ(total["received"].get<std::uint64_t>(),
            total["data"].get<std::uint64_t>() + total["position"].get<std::uint64_t>() + rejected);
  EXPECT_EQ(total["data"], 0);
  const Child play(endlessly(capture()));
  EXPECT_TRUE(daemon.wait_for_line("tracking"));
}

TEST_F(Inputs, SilentLidarIsStaleInTheDiagnostics) {
  const auto last_is = [](const std::string& level) {
    return [=](const std::vector<std::string>& lines) {
      const auto last = std::find_if(lines.rbegin(), lines.rend(), [](const std::string& line) {
        return line.starts_with("diagnostics ") && line.ends_with("locusd: lidar front");
      });
      return last != lines.rend() && last->starts_with("diagnostics " + level + ' ');
    };
  };
  const Child daemon(locusd(config()));
  ASSERT_TRUE(daemon.wait_for_line("DDS is up"));
  const Child listener({CYCLONE_PEER, "0", "listen", "/locus"});
  {
    const Child play(endlessly(capture()));
    EXPECT_TRUE(listener.wait_until(last_is("0"))) << testing::PrintToString(listener.lines());
  }
  EXPECT_TRUE(listener.wait_until(last_is("3"))) << testing::PrintToString(listener.lines());
}

/// A topic that toggles a hundred times a second switches at most once a second.
TEST_F(Inputs, FlatGroundTopicSwitchesAtMostOnceASecond) {
  const Child daemon(locusd(config("flat_ground: off\ndds: {flat_ground_topic: /wheel_health}\n")));
  ASSERT_TRUE(daemon.wait_for_line("DDS is up"));
  const auto before = std::chrono::steady_clock::now();
  const Child talker({CYCLONE_PEER, "0", "talk", "/locus"});
  constexpr std::ptrdiff_t kSwitches = 4;
  EXPECT_TRUE(daemon.wait_until([](const std::vector<std::string>& lines) {
    return std::ranges::count_if(lines, [](const std::string& line) {
             return line.find("flat ground turned") != std::string::npos;
           }) >= kSwitches;
  }));
  EXPECT_TRUE(daemon.has_line("flat ground turned on by a message on /wheel_health"));
  EXPECT_GE(std::chrono::steady_clock::now() - before, seconds{kSwitches - 1});
}

} // namespace
} // namespace locus::test
