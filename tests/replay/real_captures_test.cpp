// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <algorithm>
#include <numbers>

#include "replay_run.hpp"
#include "support/test_data.hpp"

namespace locus::test {
namespace {

/// Captures of real sensors, through the program as users run it: lidar alone, no configuration.
class RealCapture : public testing::Test {
 protected:
  void SetUp() override {
    if (!std::filesystem::exists(test_data()))
      GTEST_SKIP() << "no real captures in " << test_data() << "; set LOCUS_TEST_DATA";
  }
  static Replay replay(const std::string& name) {
    return Replay({(test_data() / "velodyne" / (name + ".pcap")).string()});
  }
  static void expect_still(const Replay& replay) {
    double moved_m = 0, turned_deg = 0;
    for (const StampedPose& row : replay.trajectory()) {
      moved_m = std::max(moved_m, row.pose.translation.norm());
      turned_deg = std::max(turned_deg, angle_rad(row.pose.rotation) * 180 / std::numbers::pi);
    }
    EXPECT_LT(moved_m, 0.02);
    EXPECT_LT(turned_deg, 0.1);
  }
};

TEST_F(RealCapture, CarAtFifteenMetresPerSecond) {
  const Replay car = replay("hdl32e_moving_15mps");
  ASSERT_EQ(car.run().status, 0) << car.run().err;
  EXPECT_EQ(car.summary()["packets"]["total"]["data"], 876);
  EXPECT_EQ(car.summary()["packets"]["total"]["position"], 100);
  const auto trajectory = car.trajectory();
  ASSERT_GE(trajectory.size(), 5U);
  double path_m = 0;
  for (std::size_t i = 2; i < trajectory.size(); ++i)
    path_m += (trajectory[i].pose.translation - trajectory[i - 1].pose.translation).norm();
  const Duration elapsed = trajectory.back().stamp - trajectory[1].stamp;
  EXPECT_GT(path_m / to_seconds(elapsed), 14.6);
  EXPECT_LT(path_m / to_seconds(elapsed), 15.4);
  const Eigen::Quaterniond turn = trajectory[1].pose.rotation.conjugate() * trajectory.back().pose.rotation;
  const double yaw_dps = to_rpy_rad(turn).z() * 180 / std::numbers::pi / to_seconds(elapsed);
  EXPECT_LT(yaw_dps, 0.0) << "clockwise";
  EXPECT_GT(yaw_dps, -3.0);
}

TEST_F(RealCapture, StandingHdl32) {
  const Replay standing = replay("hdl32e_static_monterey");
  ASSERT_EQ(standing.run().status, 0) << standing.run().err;
  EXPECT_EQ(standing.summary()["packets"]["total"]["data"], 2702);
  EXPECT_EQ(standing.summary()["packets"]["total"]["position"], 299);
  EXPECT_NEAR(static_cast<double>(standing.trajectory().size()), 17.6, 1);
  expect_still(standing);
}

TEST_F(RealCapture, StandingVlp16ThatReportsAnotherModel) {
  const Replay standing = replay("vlp16_static_1200rpm_product21");
  ASSERT_EQ(standing.run().status, 0) << standing.run().err;
  EXPECT_EQ(standing.summary()["packets"]["total"]["data"], 1902);
  EXPECT_EQ(standing.summary()["packets"]["total"]["position"], 367);
  EXPECT_NEAR(static_cast<double>(standing.trajectory().size()), 50.4, 1);
  expect_still(standing);
}

TEST_F(RealCapture, StandingVlp16WithGps) {
  const Replay standing = replay("vlp16_static_gps_pps");
  ASSERT_EQ(standing.run().status, 0) << standing.run().err;
  EXPECT_EQ(standing.summary()["packets"]["total"]["data"], 293);
  EXPECT_EQ(standing.summary()["packets"]["total"]["position"], 57);
  EXPECT_NEAR(static_cast<double>(standing.trajectory().size()), 3.9, 1);
}

} // namespace
} // namespace locus::test
