// SPDX-License-Identifier: Apache-2.0
// Configuration that locusctl finds on the network.
#include <chrono>
#include <fstream>
#include <functional>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "dds/room_cloud.hpp"
#include "locus_replay/failure.hpp"
#include "locusctl/sensors.hpp"
#include "robot_network.hpp"
#include "support/errors.hpp"

namespace locus::test {
namespace {

class Sensors : public RobotNetwork {};

TEST_F(Sensors, ProposedConfigurationMatchesTheWire) {
  const Child play(endlessly(capture()));
  ASSERT_TRUE(play.wait_for_line("has no subscriber")) << "it waits for a service, and then sends";
  const ProgramRun found = ctl({"sensors"});
  ASSERT_EQ(found.status, 0) << found.err;
  for (const char* const line :
       {"model: VLP-16  # by its packets\n", "    topic: /wheel_odometry  # nav_msgs/Odometry, ",
        "    topic: /imu/data  # sensor_msgs/Imu, ", "in m/s^2, as required; the only one\n",
        "# measure where it is on the robot\n"})
    EXPECT_TRUE(contains(found.out, line)) << "no '" << line << "' in:\n" << found.out;
  std::ofstream{file("found.yaml")} << found.out;
  const ProgramRun check = run_program(LOCUSD, {"--config", file("found.yaml").string(), "--check-config", "--live"});
  EXPECT_EQ(check.status, 0) << check.out << check.err << found.out;
}

TEST_F(Sensors, LidarAloneIsProposedWithoutPublishers) {
  const Child play(endlessly(capture()));
  ASSERT_TRUE(play.wait_for_line("has no subscriber"));
  const ProgramRun found = ctl({"sensors", "--domain", "7"});
  ASSERT_EQ(found.status, 0) << found.err;
  EXPECT_TRUE(contains(found.out, "motion_sources: []  # no IMU or odometry in domain 7 on lo; ")) << found.out;
  EXPECT_TRUE(contains(found.out, "  # - name: imu  # not used: nothing of its kind in domain 7 on lo")) << found.out;
  EXPECT_TRUE(contains(found.out, "  domain: 7  # as this command listened\n")) << found.out;
}

/// Clouds of a driver in another process. Its network discovers it when it does, so the search lasts until then.
class SensorsWithCloudsOf : public Sensors, public testing::WithParamInterface<const char*> {
 protected:
  /// Returns the proposal of a search that ends when `is_complete`.
  static std::string proposal_when(const std::function<bool(const std::string&)>& is_complete) {
    tools::SensorSearch search{DdsOptions{}};
    std::string proposal;
    EXPECT_TRUE(comes_true([&] {
      search.listen(std::chrono::milliseconds{100});
      try {
        proposal = search.proposal();
      } catch (const tools::Failure& no_lidar_yet) {
        proposal = no_lidar_yet.what();
      }
      return is_complete(proposal);
    })) << proposal;
    return proposal;
  }
  static void expect_lines(const std::string& proposal, const std::vector<std::string>& lines) {
    for (const std::string& line : lines)
      EXPECT_TRUE(contains(proposal, line)) << "no '" << line << "' in:\n" << proposal;
  }

  const std::string points_ = std::to_string(room_cloud::kPoints);
};

TEST_P(SensorsWithCloudsOf, ProposedConfigurationHasTheirTopicAndMounting) {
  const Child mounting({CYCLONE_PEER, "0", "mount", "/locus"}), driver({GetParam(), "0", "clouds", "/locus"});
  const std::string found = proposal_when([](const std::string& text) { return contains(text, "by /tf_static"); });
  expect_lines(found,
               {"  - name: lidar1\n", "    topic: /points  # clouds of " + points_ + " points\n",
                "    T_base_lidar: {xyz_m: [0.1, 0, 0.75], rpy_deg: [0, 0, 0]}  # lidar on the base, by /tf_static\n",
                "motion_sources: []  # no IMU or odometry in domain 0 on lo"});
  std::ofstream{file("found.yaml")} << found;
  const ProgramRun check = run_program(LOCUSD, {"--config", file("found.yaml").string(), "--check-config"});
  EXPECT_EQ(check.status, 0) << check.out << check.err << found;
}

TEST_P(SensorsWithCloudsOf, LivoxIsProposed) {
  const Child driver({GetParam(), "0", "livox", "/locus"});
  const std::string line = "    topic: /points  # clouds of " + std::to_string(room_cloud::kLivoxPoints) + " points\n";
  proposal_when([&](const std::string& text) { return contains(text, line); });
}

TEST_P(SensorsWithCloudsOf, PacketsArePreferredToThem) {
  const Child driver({GetParam(), "0", "clouds", "/locus"}), play(endlessly(capture()));
  const std::string found = proposal_when(
      [](const std::string& text) { return contains(text, "model: VLP-16") && contains(text, "topic: /points"); });
  expect_lines(found,
               {"  - name: lidar1", "    model: VLP-16  # by its packets\n",
                "  # - name: lidar2  # not used: clouds of " + points_ + " points; packets, or clouds with more ",
                "  #   topic: /points\n"});
}

INSTANTIATE_TEST_SUITE_P(Peers, SensorsWithCloudsOf, testing::Values(CYCLONE_PEER, FAST_DDS_PEER),
                         [](const auto& tested) { return std::string{tested.index == 0 ? "Cyclone" : "FastDds"}; });

} // namespace
} // namespace locus::test
