// SPDX-License-Identifier: Apache-2.0
#include <chrono>
#include <cstdlib>
#include <fstream>
#include <memory>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "service/robot_network.hpp"
#include "service/undisturbed.hpp"

namespace locus::test {
namespace {

using nlohmann::json;
using std::chrono::seconds;

/// The lidar is a host of its own, 10.9.0.201, at the other end of a cable to 10.9.0.1.
class LidarNetwork : public RobotNetwork {
 protected:
  static void here(const std::string& command) {
    ASSERT_EQ(std::system(command.c_str()), 0) << command; // NOLINT(concurrency-mt-unsafe, cert-env33-c)
  }
  void at_lidar(const std::string& command) const { here(fmt::format("nsenter -t {} -n {}", lidar_->pid(), command)); }

  void lay_cable() {
    lidar_ = std::make_unique<Child>(std::vector<std::string>{"/usr/bin/unshare", "--net", "/bin/sh", "-c",
                                                              "ip link set lo up; echo up; exec sleep 1000"});
    ASSERT_TRUE(lidar_->wait_for_line("up", seconds{5}));
    here(fmt::format("ip link add lidar0 type veth peer name eth0 netns {}", lidar_->pid()));
    here("ip addr add 10.9.0.1/24 dev lidar0");
    here("ip link set lidar0 up");
    at_lidar("ip addr add 10.9.0.201/24 dev eth0");
    at_lidar("ip addr add 10.9.0.202/24 dev eth0");
    at_lidar("ip link set eth0 up");
    at_lidar("ip route add default dev eth0 src 10.9.0.201");
  }

  [[nodiscard]] std::vector<std::string> play(const std::string& to) const {
    return undisturbed({"/usr/bin/nsenter", "-t", std::to_string(lidar_->pid()), "-n", LOCUS_PLAY, "--interface",
                        "eth0", "--to", to, capture().string()});
  }

  [[nodiscard]] std::uint64_t data_packets() const { return status()["packets"]["total"]["data"].get<std::uint64_t>(); }

  /// A second of what it sends arrive, and nothing is missing.
  void expect_heard(const std::string& to) const {
    const std::uint64_t before = data_packets();
    const Child lidar(play(to));
    EXPECT_TRUE(status_comes(
        [&](const json& s) { return s["packets"]["total"]["data"].get<std::uint64_t>() > before + 750; }, seconds{15}))
        << to;
    const json status = this->status();
    EXPECT_EQ(status["packets"]["total"]["lost"], 0) << to;
    EXPECT_EQ(status["lidars"]["front"]["source_ip"], "10.9.0.201") << to;
    EXPECT_EQ(status["lidars"]["front"]["model"], "VLP-16") << to;
  }

 private:
  std::unique_ptr<Child> lidar_;
};

TEST_F(LidarNetwork, LidarIsHeardByUnicast) {
  lay_cable();
  const Child daemon(undisturbed(locusd(config())));
  ASSERT_TRUE(daemon.wait_for_line("DDS is up", seconds{10}));
  expect_heard("10.9.0.1");
}

TEST_F(LidarNetwork, LidarIsHeardByBroadcastToItsNetworkAndToAll) {
  for (const char* to : {"10.9.0.255", "255.255.255.255"}) {
    lay_cable();
    const Child daemon(undisturbed(locusd(config())));
    ASSERT_TRUE(daemon.wait_for_line("DDS is up", seconds{10}));
    expect_heard(to);
    here("ip link del lidar0");
  }
}

/// Of a network that is there only after the service has started.
TEST_F(LidarNetwork, LidarIsHeardByMulticastOnceItsNetworkIsThere) {
  std::string text = read_text(config());
  text.replace(text.find("{name: front,"), 13, "{name: front, multicast_ip: 239.1.2.3,");
  std::ofstream{file("multicast.yaml")} << text;
  const Child daemon(undisturbed(locusd(file("multicast.yaml"))));
  ASSERT_TRUE(daemon.wait_for_line("DDS is up", seconds{10}));
  lay_cable();
  expect_heard("239.1.2.3");
}

/// Two lidars that take turns would be one that jumps, so a new address counts once the old one has fallen silent.
TEST_F(LidarNetwork, LidarThatChangesItsAddressIsTakenBack) {
  lay_cable();
  const Child daemon(undisturbed(locusd(config())));
  ASSERT_TRUE(daemon.wait_for_line("DDS is up", seconds{10}));
  const Child lidar(play("10.9.0.1"));
  ASSERT_TRUE(daemon.wait_for_line("tracking", seconds{10}));
  at_lidar("ip route replace 10.9.0.0/24 dev eth0 src 10.9.0.202");
  EXPECT_TRUE(
      status_comes([](const json& s) { return s["lidars"]["front"]["source_ip"] == "10.9.0.202"; }, seconds{8}));
  const std::uint64_t before = data_packets();
  EXPECT_TRUE(status_comes(
      [&](const json& s) {
        return s["packets"]["total"]["data"].get<std::uint64_t>() > before + 750 && s["state"] == "tracking";
      },
      seconds{8}));
}

/// docs/examples/locusd.nft: another host on the lidar's cable gets nothing through, the lidar everything.
TEST_F(LidarNetwork, FirewallLetsTheLidarPassAndNobodyElse) {
  lay_cable();
  std::string rules = read_text(FIREWALL);
  for (const auto& [of_the_example, ours] :
       {std::pair{"\"eth1\"", "\"lidar0\""}, std::pair{"192.168.1.201, 192.168.1.202", "10.9.0.201"}}) {
    ASSERT_NE(rules.find(of_the_example), std::string::npos);
    rules.replace(rules.find(of_the_example), std::string(of_the_example).size(), ours);
  }
  std::ofstream{file("locusd.nft")} << rules;
  here("/usr/sbin/nft -f " + file("locusd.nft").string());
  const Child daemon(undisturbed(locusd(config())));
  ASSERT_TRUE(daemon.wait_for_line("DDS is up", seconds{10}));
  at_lidar("ip route replace 10.9.0.0/24 dev eth0 src 10.9.0.202");
  {
    const Child other(play("10.9.0.1"));
    ASSERT_TRUE(other.wait_for_line("it is sent all the same", seconds{10})) << testing::PrintToString(other.lines());
    std::this_thread::sleep_for(seconds{2});
  }
  EXPECT_EQ(status()["packets"]["total"]["received"], 0);
  const std::string counted = run_program("/usr/sbin/nft", {"list", "chain", "inet", "locusd", "from_lidars"}).out;
  const std::size_t counter = counted.find("counter packets ");
  ASSERT_NE(counter, std::string::npos) << counted;
  EXPECT_GT(std::stoi(counted.substr(counter + 16)), 1000) << "dropped of what it sent";
  at_lidar("ip route replace 10.9.0.0/24 dev eth0 src 10.9.0.201");
  expect_heard("10.9.0.1");
  const json total = status()["packets"]["total"];
  EXPECT_EQ(total["data"].get<int>() + total["position"].get<int>(), total["received"].get<int>());
}

TEST_F(LidarNetwork, CableThatIsPulledAndPutBack) {
  lay_cable();
  Child daemon(undisturbed(locusd(config())));
  ASSERT_TRUE(daemon.wait_for_line("DDS is up", seconds{10}));
  const Child lidar(play("10.9.0.255"));
  ASSERT_TRUE(daemon.wait_for_line("tracking", seconds{10}));
  here("ip link set lidar0 down");
  EXPECT_TRUE(status_comes([](const json& s) { return s["state"] == "dead_reckoning"; }, seconds{5}));
  const std::uint64_t before = data_packets();
  std::this_thread::sleep_for(seconds{1});
  EXPECT_EQ(data_packets(), before);
  here("ip link set lidar0 up");
  EXPECT_TRUE(status_comes(
      [&](const json& s) {
        return s["packets"]["total"]["data"].get<std::uint64_t>() > before + 750 && s["state"] != "dead_reckoning";
      },
      seconds{8}));
  EXPECT_GT(status()["packets"]["total"]["lost"].get<int>(), 700) << "what was sent in that second";
}

} // namespace
} // namespace locus::test
