// SPDX-License-Identifier: Apache-2.0
// The service's node in the ROS 2 graph, as discovered by two implementations of DDS.
#include <algorithm>
#include <cstdlib>
#include <memory>
#include <string>
#include <vector>

#include "service/robot_network.hpp"

namespace locus::test {
namespace {

class RosNodeOfService : public RobotNetwork {};

/// Waits until the last node that the peer discovered has this name and claims this number of writers.
bool hears_node(const Child& peer, const std::string& node, std::ptrdiff_t writers) {
  const auto begins_with = [](const char* word) {
    return [word](const std::string& line) { return line.starts_with(word); };
  };
  return peer.wait_until([&](const std::vector<std::string>& lines) {
    const auto begins = std::find_if(lines.rbegin(), lines.rend(), begins_with("node "));
    return begins != lines.rend() && begins->starts_with("node " + node + " ") &&
           std::any_of(begins.base(), lines.end(), begins_with("node_end ")) &&
           std::count_if(begins.base(), lines.end(), begins_with("node_writer ")) == writers;
  });
}

/// Topics added by a reload are claimed, too.
TEST_F(RosNodeOfService, HasTheNameOfTheInstanceAndAllItsTopics) {
  const std::filesystem::path runtime = file("locusd@left");
  setenv("RUNTIME_DIRECTORY", runtime.c_str(), 1); // NOLINT(concurrency-mt-unsafe)
  const Child cyclone({CYCLONE_PEER, "0", "iron", "/locus"}), fast_dds({FAST_DDS_PEER, "0", "iron", "/locus"});
  const Child daemon(locusd(config()));
  constexpr std::ptrdiff_t kAlways = 6; // odometry, odometry_fast, state, beginning, resets, diagnostics
  for (const Child* peer : {&cyclone, &fast_dds})
    EXPECT_TRUE(hears_node(*peer, "/ locusd_left", kAlways)) << testing::PrintToString(peer->lines());
  ASSERT_TRUE(daemon.wait_for_line("DDS is up")) << testing::PrintToString(daemon.lines());
  static_cast<void>(config("dds: {publish_tf: true, publish_map: true, prefix: /robot_7/locus}\n"));
  const ProgramRun reload = run_program(LOCUSCTL, {"--socket", (runtime / "control").string(), "reload"});
  ASSERT_EQ(reload.status, 0) << reload.err;
  for (const Child* peer : {&cyclone, &fast_dds})
    EXPECT_TRUE(hears_node(*peer, "/robot_7 locusd_left", kAlways + 2)) << testing::PrintToString(peer->lines());
}

TEST_F(RosNodeOfService, SingleServiceIsNamedLocusdInTheConfiguredLayout) {
  const Child cyclone({CYCLONE_PEER, "0", "humble", "/locus"}), fast_dds({FAST_DDS_PEER, "0", "humble", "/locus"});
  const Child daemon(locusd(config("dds: {ros_graph: humble}\n")));
  for (const Child* peer : {&cyclone, &fast_dds})
    EXPECT_TRUE(hears_node(*peer, "/ locusd", 6)) << testing::PrintToString(peer->lines());
}

/// Cyclone DDS without multicast would find ten participants at most.
TEST_F(RosNodeOfService, IsFoundByThirteenOtherParticipantsOnLoopback) {
  const Child daemon(locusd(config()));
  std::vector<std::unique_ptr<Child>> peers;
  for (int i = 0; i < 13; ++i)
    peers.push_back(std::make_unique<Child>(
        std::vector<std::string>{i % 2 == 0 ? CYCLONE_PEER : FAST_DDS_PEER, "0", "iron", "/locus"}));
  constexpr std::ptrdiff_t kAlways = 6;
  for (const auto& peer : peers)
    EXPECT_TRUE(hears_node(*peer, "/ locusd", kAlways)) << testing::PrintToString(peer->lines());
}

/// As DHCP does. A participant would announce the address of its start for ever.
TEST_F(RosNodeOfService, IsFoundAtTheNewAddressOfItsInterface) {
  const auto run = [](const char* command) {
    return std::system(command);
  }; // NOLINT(concurrency-mt-unsafe, cert-env33-c)
  const Child daemon(locusd(config()));
  ASSERT_TRUE(daemon.wait_for_line("DDS is up"));
  ASSERT_EQ(status()["state"], "waiting");
  if (run("ip address del 127.0.0.1/8 dev lo && ip address add 127.0.0.2/8 dev lo") != 0)
    GTEST_SKIP() << "there is no ip";
  EXPECT_TRUE(daemon.wait_for_line("the address of lo changed from 127.0.0.1 to 127.0.0.2: DDS is started again"))
      << testing::PrintToString(daemon.lines());
  const Child peer({CYCLONE_PEER, "0", "iron", "/locus"});
  EXPECT_TRUE(hears_node(peer, "/ locusd", 6)) << testing::PrintToString(daemon.lines());
  const auto is_about_address = [](const std::string& line) { return line.find("address of lo") != std::string::npos; };
  EXPECT_EQ(std::ranges::count_if(daemon.lines(), is_about_address), 1);
}

} // namespace
} // namespace locus::test
