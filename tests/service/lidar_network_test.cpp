// SPDX-License-Identifier: Apache-2.0
#include <cstdlib>
#include <fstream>
#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <yaml-cpp/yaml.h>

#include "drivers/files/capture.hpp"
#include "drivers/velodyne/model.hpp"
#include "service/robot_network.hpp"

namespace locus::test {
namespace {

using nlohmann::json;

/// The lidar is a separate host, 10.9.0.201, connected by a cable to 10.9.0.1.
class LidarNetwork : public RobotNetwork {
 protected:
  void SetUp() override {
    RobotNetwork::SetUp();
    if (IsSkipped() || HasFatalFailure())
      return;
    if (run_program("/usr/bin/unshare", {"--net", "/bin/true"}).status != 0)
      GTEST_SKIP() << "no network namespace for the lidar: run as root";
    if (run_program("/bin/sh", {"-c", "ip link add probe0 type veth peer name probe1 && ip link del probe0"}).status !=
        0)
      GTEST_SKIP() << "this kernel has no veth, or there is no ip";
  }

  static void here(const std::string& command) {
    ASSERT_EQ(std::system(command.c_str()), 0) << command; // NOLINT(concurrency-mt-unsafe, cert-env33-c)
  }
  void at_lidar(const std::string& command) const { here(fmt::format("nsenter -t {} -n {}", lidar_->pid(), command)); }

  void lay_cable() {
    lidar_ = std::make_unique<Child>(std::vector<std::string>{"/usr/bin/unshare", "--net", "/bin/sh", "-c",
                                                              "ip link set lo up; echo up; exec sleep 1000"});
    ASSERT_TRUE(lidar_->wait_for_line("up"));
    here(fmt::format("ip link add lidar0 type veth peer name eth0 netns {}", lidar_->pid()));
    here("ip addr add 10.9.0.1/24 dev lidar0");
    here("ip link set lidar0 up");
    at_lidar("ip addr add 10.9.0.201/24 dev eth0");
    at_lidar("ip addr add 10.9.0.202/24 dev eth0");
    at_lidar("ip link set eth0 up");
    at_lidar("ip route add default dev eth0 src 10.9.0.201");
  }

  /// Returns the command that runs a player at the lidar.
  [[nodiscard]] std::vector<std::string> player_at_lidar(std::vector<std::string> player) const {
    player.insert(player.begin(), {"/usr/bin/nsenter", "-t", std::to_string(lidar_->pid()), "-n"});
    return player;
  }
  [[nodiscard]] std::vector<std::string> play(const std::string& to) const {
    return player_at_lidar({LOCUS_PLAY, "--interface", "eth0", "--to", to, capture().string()});
  }
  [[nodiscard]] std::vector<std::string> play_endlessly(const std::string& to) const {
    std::vector<std::string> command = play(to);
    command.insert(command.begin(), {"/bin/sh", "-c", "while setpriv --pdeathsig KILL \"$@\"; do :; done", "sh"});
    return command;
  }

  [[nodiscard]] std::uint64_t data_packets() const { return status()["packets"]["total"]["data"].get<std::uint64_t>(); }

  /// Waits for one more second of data packets and for `more` to hold.
  [[nodiscard]] bool comes_since(std::uint64_t before, const std::function<bool(const json&)>& more) const {
    return status_comes([&](const json& status) {
      return status["packets"]["total"]["data"].get<std::uint64_t>() > before + 750 && more(status);
    });
  }

  /// Returns the configuration of the capture without motion sources, whose topics do not reach the lidar's host.
  [[nodiscard]] std::filesystem::path lidar_alone(const std::string& multicast_ip = "") const {
    YAML::Node config = YAML::LoadFile(this->config().string());
    config["motion_sources"] = YAML::Node(YAML::NodeType::Sequence);
    if (!multicast_ip.empty())
      config["lidars"][0]["multicast_ip"] = multicast_ip;
    std::filesystem::create_directory(file("lidar_alone"));
    std::ofstream{file("lidar_alone/config.yaml")} << config;
    std::filesystem::copy_file(capture() / "lidar.pcap", file("lidar_alone/lidar.pcap"),
                               std::filesystem::copy_options::overwrite_existing);
    return file("lidar_alone/config.yaml");
  }

  /// Expects the service, which is led, to receive each packet of the drive of lidar_alone().
  void expect_heard(const std::string& to) const {
    Child lidar(player_at_lidar(leading_play({"--interface", "eth0", "--to", to, file("lidar_alone").string()})));
    ASSERT_EQ(lidar.wait_for_exit(patience_of_a_drive()), 0) << to << testing::PrintToString(lidar.lines());
    const std::uint64_t sent = datagrams_in(capture() / "lidar.pcap");
    const json status = status_when([&](const json& s) { return s["packets"]["total"]["received"] == sent; });
    EXPECT_EQ(status["packets"]["total"]["lost"], 0) << to;
    EXPECT_EQ(status["lidars"]["front"]["source_ip"], "10.9.0.201") << to;
    EXPECT_EQ(status["lidars"]["front"]["model"], "VLP-16") << to;
  }

 private:
  std::unique_ptr<Child> lidar_;
};

TEST_F(LidarNetwork, UnicastIsReceived) {
  lay_cable();
  const Child daemon(led_locusd(lidar_alone()));
  ASSERT_TRUE(daemon.wait_for_line("DDS is up"));
  expect_heard("10.9.0.1");
}

TEST_F(LidarNetwork, BroadcastToTheNetworkAndToAllIsReceived) {
  for (const char* to : {"10.9.0.255", "255.255.255.255"}) {
    lay_cable();
    const Child daemon(led_locusd(lidar_alone()));
    ASSERT_TRUE(daemon.wait_for_line("DDS is up"));
    expect_heard(to);
    here("ip link del lidar0");
  }
}

/// The network appears only after the service has started.
TEST_F(LidarNetwork, MulticastIsReceivedOnceTheNetworkIsUp) {
  const Child daemon(led_locusd(lidar_alone("239.1.2.3")));
  ASSERT_TRUE(daemon.wait_for_line("DDS is up"));
  lay_cable();
  ASSERT_TRUE(comes_true([] { // the group's address as the kernel prints it, of the cable's interface alone
    const std::string groups = read_text("/proc/thread-self/net/igmp");
    const std::size_t cable = groups.find("lidar0");
    return cable != std::string::npos && groups.find("030201EF", cable) != std::string::npos;
  }));
  expect_heard("239.1.2.3");
}

/// Alternating packets of two lidars would look like one that jumps, so a new address is accepted only after the old
/// one is silent.
TEST_F(LidarNetwork, LidarWithANewAddressIsAcceptedAgain) {
  lay_cable();
  const Child daemon(locusd(config()));
  ASSERT_TRUE(daemon.wait_for_line("DDS is up"));
  const Child lidar(play_endlessly("10.9.0.1"));
  ASSERT_TRUE(daemon.wait_for_line("tracking"));
  at_lidar("ip route replace 10.9.0.0/24 dev eth0 src 10.9.0.202");
  EXPECT_TRUE(status_comes([](const json& s) { return s["lidars"]["front"]["source_ip"] == "10.9.0.202"; }));
  const std::uint64_t before = data_packets();
  EXPECT_TRUE(comes_since(before, [](const json& s) { return s["state"] == "tracking"; }));
}

/// docs/examples/locusd.nft: drops everything from other hosts on the lidar's cable, and nothing from the lidar.
TEST_F(LidarNetwork, FirewallPassesOnlyTheLidar) {
  if (run_program("/usr/sbin/nft", {"add", "table", "inet", "probe"}).status != 0)
    GTEST_SKIP() << "this kernel has no nf_tables, or there is no nft";
  lay_cable();
  std::string rules = read_text(FIREWALL);
  for (const auto& [of_the_example, ours] :
       {std::pair{"\"eth1\"", "\"lidar0\""}, std::pair{"192.168.1.201, 192.168.1.202", "10.9.0.201"}}) {
    ASSERT_NE(rules.find(of_the_example), std::string::npos);
    rules.replace(rules.find(of_the_example), std::string(of_the_example).size(), ours);
  }
  std::ofstream{file("locusd.nft")} << rules;
  here("/usr/sbin/nft -f " + file("locusd.nft").string());
  const Child daemon(led_locusd(lidar_alone()));
  ASSERT_TRUE(daemon.wait_for_line("DDS is up"));
  at_lidar("ip route replace 10.9.0.0/24 dev eth0 src 10.9.0.202");
  const auto dropped = [] {
    const std::string counted = run_program("/usr/sbin/nft", {"list", "chain", "inet", "locusd", "from_lidars"}).out;
    const std::size_t counter = counted.find("counter packets ");
    EXPECT_NE(counter, std::string::npos) << counted;
    return counter == std::string::npos ? 0 : std::stoi(counted.substr(counter + 16));
  };
  {
    const Child other(play_endlessly("10.9.0.1"));
    EXPECT_TRUE(comes_true([&] { return dropped() > 1000; })) << testing::PrintToString(other.lines());
  }
  EXPECT_EQ(status()["packets"]["total"]["received"], 0);
  at_lidar("ip route replace 10.9.0.0/24 dev eth0 src 10.9.0.201");
  expect_heard("10.9.0.1");
  const json total = status()["packets"]["total"];
  EXPECT_EQ(total["data"].get<int>() + total["position"].get<int>(), total["received"].get<int>());
}

/// Everything sent meanwhile is lost and counted.
TEST_F(LidarNetwork, PacketsLostWhileUnpluggedAreCounted) {
  lay_cable();
  const Child daemon(locusd(config()));
  ASSERT_TRUE(daemon.wait_for_line("DDS is up"));
  Child lidar(play("10.9.0.255"));
  ASSERT_TRUE(daemon.wait_for_line("tracking"));
  here("ip link set lidar0 down");
  const json pulled = status_when([](const json& s) {
    return s["state"] == "dead_reckoning" && s["lidars"]["front"]["heard_ms_ago"].get<double>() > 1000;
  });
  here("ip link set lidar0 up");
  EXPECT_TRUE(comes_since(pulled["packets"]["total"]["data"].get<std::uint64_t>(),
                          [](const json& s) { return s["state"] != "dead_reckoning"; }));
  EXPECT_EQ(lidar.wait_for_exit(), 0);
  std::uint64_t sent = 0;
  for (auto capture = Capture::open(this->capture() / "lidar.pcap"); const Datagram* datagram = capture->next();)
    sent += datagram->payload.size() == velodyne::kDataPacketBytes ? 1U : 0U;
  EXPECT_TRUE(status_comes([&](const json& s) {
    const json& total = s["packets"]["total"];
    return total["lost"].get<std::uint64_t>() > 0 &&
           total["data"].get<std::uint64_t>() + total["lost"].get<std::uint64_t>() == sent;
  })) << status()["packets"].dump(1)
      << sent;
}

} // namespace
} // namespace locus::test
