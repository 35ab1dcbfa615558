// SPDX-License-Identifier: Apache-2.0
// Configuration that locusctl finds on the network.
#include <fstream>

#include <gtest/gtest.h>

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

} // namespace
} // namespace locus::test
