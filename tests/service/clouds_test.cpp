// SPDX-License-Identifier: Apache-2.0
// A lidar whose driver publishes clouds, live.
#include <chrono>
#include <csignal>
#include <fstream>
#include <thread>

#include "dds/room_cloud.hpp"
#include "service/robot_network.hpp"
#include "service/undisturbed.hpp"

namespace locus::test {
namespace {

using nlohmann::json;
using std::chrono::milliseconds;
using std::chrono::seconds;

const std::string kConfig = "lidars: [{name: top, topic: /points}]\nmotion_sources: []\n";

class LiveClouds : public RobotNetwork {
 protected:
  [[nodiscard]] std::filesystem::path written(const std::string& yaml) const {
    std::ofstream{file("clouds.yaml")} << yaml;
    return file("clouds.yaml");
  }
};

class LiveCloudsOf : public LiveClouds, public testing::WithParamInterface<const char*> {};

/// Of the clouds that were published in five seconds nearly all are used, none is refused, and the robot stands.
TEST_P(LiveCloudsOf, AreUsedAsTheyCome) {
  Child daemon(undisturbed(locusd(written(kConfig))));
  ASSERT_TRUE(daemon.wait_for_line("DDS is up", seconds{10}));
  Child peer(undisturbed({GetParam(), "0", "clouds", "/locus"}));
  ASSERT_TRUE(
      status_comes([](const json& status) { return status["lidars"]["top"]["clouds"]["used"] > 50; }, seconds{20}))
      << status().dump(1);
  const json all = status(), top = all["lidars"]["top"];
  peer.signal(SIGSTOP);
  std::this_thread::sleep_for(milliseconds{300});
  const json clouds = status()["lidars"]["top"]["clouds"]; // of all that it sent
  EXPECT_EQ(clouds["used"], clouds["received"]);
  EXPECT_LE(clouds["dropped"], 5);
  EXPECT_EQ(clouds["points"].get<std::uint64_t>(), clouds["used"].get<std::uint64_t>() * room_cloud::kPoints);
  for (const auto& [reason, count] : clouds["refused"].items())
    EXPECT_EQ(count, 0) << reason;
  EXPECT_NEAR(clouds["rate_hz"].get<double>(), 10, 1);
  EXPECT_EQ(clouds["times"], "field");
  EXPECT_EQ(top["problem"], "");
  EXPECT_TRUE(all["state"] == "standstill" || all["state"] == "tracking") << all["state"];
  for (const double metres : all["pose"]["xyz_m"])
    EXPECT_NEAR(metres, 0, 0.02);
  EXPECT_NEAR(all["rate_hz"].get<double>(), 10, 2);
}

INSTANTIATE_TEST_SUITE_P(Peers, LiveCloudsOf, testing::Values(CYCLONE_PEER, FAST_DDS_PEER),
                         [](const auto& tested) { return std::string{tested.index == 0 ? "Cyclone" : "FastDds"}; });

TEST_F(LiveClouds, DriverThatIsMissingIsNamed) {
  Child daemon(locusd(written(kConfig)));
  EXPECT_TRUE(daemon.wait_for_line("lidar top: no cloud on topic /points for 5 s", seconds{15}));
}

/// Nothing that waits for clouds waits for ever, and whoever comes back is heard.
TEST_F(LiveClouds, DriverThatIsRestartedIsHeardAgain) {
  Child daemon(locusd(written(kConfig)));
  ASSERT_TRUE(daemon.wait_for_line("DDS is up", seconds{10}));
  const auto used = [&] { return status()["lidars"]["top"]["clouds"]["used"].get<int>(); };
  for (int round = 0; round < 2; ++round) {
    const int before = used();
    Child peer({CYCLONE_PEER, "0", "clouds", "/locus"});
    EXPECT_TRUE(status_comes(
        [&](const json& status) { return status["lidars"]["top"]["clouds"]["used"] > before + 10; }, seconds{20}));
    peer.signal(SIGKILL);
  }
}

} // namespace
} // namespace locus::test
