// SPDX-License-Identifier: Apache-2.0
// Flat ground detection by the IMU, on flat and uneven ground.
#include <algorithm>
#include <cmath>
#include <span>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "simulated_drive.hpp"

namespace locus::test {
namespace {

using std::chrono::seconds;

std::vector<std::string> flat_ground(const std::string& mode) { return {"--set", "flat_ground=" + mode}; }

double height_m(const StampedPose& pose) { return pose.T_source_base.translation.z(); }

/// Returns the height above the start.
double climbed_m(const std::vector<StampedPose>& path, Stamp at) {
  const auto then = std::ranges::lower_bound(path, at, {}, &StampedPose::stamp);
  return then == path.end() ? 0.0 : height_m(*then) - height_m(path.front());
}

TEST(FlatGround, EndsWithinASecondOfTheFirstStep) {
  const SimulatedDrive drive("stairs", "husky", 40);
  const Replay found = drive.replay(flat_ground("auto")), off = drive.replay(flat_ground("off"));
  const auto truth = read_tum(drive.capture() + "/gt.tum"), path = found.trajectory();
  const auto first_step = std::ranges::find_if(
      truth, [&](const StampedPose& pose) { return std::abs(climbed_m(truth, pose.stamp)) > 0.05; });
  ASSERT_NE(first_step, truth.end()) << "the drive has a stair";
  ASSERT_LT(first_step->stamp + seconds{3}, path.back().stamp);
  for (Stamp now = first_step->stamp + seconds{1}; now < path.back().stamp; now += seconds{1})
    EXPECT_NEAR(climbed_m(path, now), climbed_m(truth, now), 0.03);
  EXPECT_LT(ape_mean_m(found), 1.1 * ape_mean_m(off));
}

TEST(FlatGround, DetectedIsHarmlessInThePlantAndHelpsWithoutLidar) {
  const SimulatedDrive drive("urban", "husky", 25);
  const Replay found = drive.replay(flat_ground("auto")), off = drive.replay(flat_ground("off"));
  EXPECT_NE(read_text(found.file("odometry.tum")), read_text(off.file("odometry.tum"))) << "flat ground was detected";
  EXPECT_LT(ape_mean_m(found), 1.05 * ape_mean_m(off));

  const auto climbed_without_lidar_m = [&](const std::string& mode) {
    std::vector<std::string> arguments = flat_ground(mode);
    arguments.insert(arguments.end(), {"--fail", "all-lidars:lost@10-20"});
    const auto path = drive.replay(arguments).trajectory();
    const Stamp lost = path.front().stamp + seconds{10};
    return std::abs(climbed_m(path, lost + seconds{9}) - climbed_m(path, lost));
  };
  EXPECT_LT(climbed_without_lidar_m("auto"), 0.5 * climbed_without_lidar_m("off"));
}

TEST(FlatGround, SetByContextFixesHeightRollAndPitch) {
  const SimulatedDrive drive("urban", "husky", 25);
  const auto path = drive.replay(flat_ground("on")).trajectory();
  ASSERT_GT(path.size(), 200U);
  for (const StampedPose& pose : std::span(path).subspan(1)) { // gravity levels the first
    ASSERT_NEAR(height_m(pose), 0.0, 1e-6);
    ASSERT_LT(to_rpy_rad(pose.T_source_base.rotation).head<2>().cwiseAbs().maxCoeff(), 1e-3);
  }
}

} // namespace
} // namespace locus::test
