// SPDX-License-Identifier: Apache-2.0
// Live clouds of lidar drivers.
#include <csignal>
#include <fstream>

#include "dds/room_cloud.hpp"
#include "service/robot_network.hpp"

namespace locus::test {
namespace {

using nlohmann::json;

const std::string kConfig = "lidars: [{name: top, topic: /points}]\nmotion_sources: []\n";

class LiveClouds : public RobotNetwork {
 protected:
  [[nodiscard]] std::filesystem::path written(const std::string& yaml) const {
    std::ofstream{file("clouds.yaml")} << yaml;
    return file("clouds.yaml");
  }
};

class LiveCloudsOf : public LiveClouds, public testing::WithParamInterface<const char*> {};

/// Every cloud that reaches the service is used, none is rejected, and the robot stands.
TEST_P(LiveCloudsOf, AreUsedOnArrival) {
  const Child daemon(locusd(written(kConfig)));
  ASSERT_TRUE(daemon.wait_for_line("DDS is up"));
  const Child peer({GetParam(), "0", "clouds", "/locus"});
  json all;
  ASSERT_TRUE(status_comes([&](const json& status) {
    all = status;
    return status["lidars"]["top"]["clouds"]["used"] > 50 &&
           (status["state"] == "standstill" || status["state"] == "tracking");
  })) << all.dump(1);
  EXPECT_EQ(all["lidars"]["top"]["problem"], "");
  for (const double metres : all["pose"]["xyz_m"])
    EXPECT_NEAR(metres, 0, 0.02);
  peer.signal(SIGSTOP);
  ASSERT_TRUE(status_comes([&](const json& status) {
    all = status;
    return status["lidars"]["top"]["clouds"]["used"] == status["lidars"]["top"]["clouds"]["received"];
  })) << all.dump(1);
  const json clouds = all["lidars"]["top"]["clouds"];
  EXPECT_EQ(clouds["points"].get<std::uint64_t>(), clouds["used"].get<std::uint64_t>() * room_cloud::kPoints);
  for (const auto& [reason, count] : clouds["refused"].items())
    EXPECT_EQ(count, 0) << reason;
  EXPECT_EQ(clouds["times"], "field");
}

/// Drivers of both types on one topic, each killed before the next begins.
TEST_P(LiveCloudsOf, AreUsedWhateverTheirType) {
  const Child daemon(locusd(written(kConfig)));
  ASSERT_TRUE(daemon.wait_for_line("DDS is up"));
  std::uint64_t used = 0, points = 0;
  for (const auto& [role, size] : {std::pair{"livox", room_cloud::kLivoxPoints}, {"clouds", room_cloud::kPoints}}) {
    const Child peer({GetParam(), "0", role, "/locus"});
    json clouds;
    ASSERT_TRUE(status_comes([&](const json& status) {
      clouds = status["lidars"]["top"]["clouds"];
      return clouds["used"] > used + 10 && clouds["points"].get<std::uint64_t>() > points + 10 * size;
    })) << role
        << clouds.dump(1);
    EXPECT_EQ(clouds["times"], "field");
    for (const auto& [reason, count] : clouds["refused"].items())
      EXPECT_EQ(count, 0) << role << ' ' << reason;
    used = clouds["used"];
    points = clouds["points"];
  }
}

/// Depends on the speed of the machine.
TEST_P(LiveCloudsOf, MatchThePublishedNumber) {
  const Child daemon(locusd(written(kConfig)));
  ASSERT_TRUE(daemon.wait_for_line("DDS is up"));
  const Child peer({GetParam(), "0", "clouds", "/locus"});
  json all;
  ASSERT_TRUE(status_comes([&](const json& status) {
    all = status;
    return status["lidars"]["top"]["clouds"]["used"] > 50;
  })) << all.dump(1);
  EXPECT_LE(all["lidars"]["top"]["clouds"]["dropped"], 5);
  EXPECT_NEAR(all["lidars"]["top"]["clouds"]["rate_hz"].get<double>(), 10, 1);
  EXPECT_NEAR(all["rate_hz"].get<double>(), 10, 2);
}

INSTANTIATE_TEST_SUITE_P(Peers, LiveCloudsOf, testing::Values(CYCLONE_PEER, FAST_DDS_PEER),
                         [](const auto& tested) { return std::string{tested.index == 0 ? "Cyclone" : "FastDds"}; });

TEST_F(LiveClouds, MissingDriverIsReported) {
  Child daemon(locusd(written(kConfig)));
  EXPECT_TRUE(daemon.wait_for_line("lidar top: no cloud on topic /points for 5 s"));
}

/// No wait for clouds is indefinite, and a publisher that returns is received.
TEST_F(LiveClouds, RestartedDriverIsReceivedAgain) {
  Child daemon(locusd(written(kConfig)));
  ASSERT_TRUE(daemon.wait_for_line("DDS is up"));
  const auto used = [&] { return status()["lidars"]["top"]["clouds"]["used"].get<int>(); };
  for (int round = 0; round < 2; ++round) {
    const int before = used();
    Child peer({CYCLONE_PEER, "0", "clouds", "/locus"});
    EXPECT_TRUE(
        status_comes([&](const json& status) { return status["lidars"]["top"]["clouds"]["used"] > before + 10; }));
    peer.signal(SIGKILL);
  }
}

} // namespace
} // namespace locus::test
