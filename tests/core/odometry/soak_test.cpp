// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <algorithm>
#include <cstddef>
#include <cstdio>
#include <fstream>
#include <string>
#include <vector>

#include "core/odometry/odometry.hpp"
#include "core/robot.hpp"
#include "support/scenes.hpp"

namespace locus::test {
namespace {

using std::chrono::seconds;

/// Returns the resident set size of this process.
std::size_t resident_bytes() {
  std::ifstream status("/proc/self/status");
  for (std::string line; std::getline(status, line);)
    if (line.starts_with("VmRSS:"))
      return 1024 * std::stoul(line.substr(6));
  return 0;
}

RobotSetup robot() {
  RobotSetup setup;
  setup.lidars.front().range_noise_m = 0.02;
  setup.wheels = sim::OdometryFaults{.scale_error = 0.005};
  setup.imu = sim::ImuFaults{.gyro_noise_radps = 0.002, .accelerometer_noise_mps2 = 0.02};
  return setup;
}

/// Ten thousand sweeps: 1000 s at 15 m/s, more street than the map can hold.
TEST(Soak, FifteenKilometresTakeNoMoreMemoryThanOne) {
  constexpr std::size_t kMostBytes = 200'000'000, kMostGrowth_bytes = 4'000'000;
  constexpr std::size_t kSettled = 2000; // sweeps
  const sim::Scene scene = sim::street(15'000);
  const sim::Trajectory trajectory(sim::Course{}.change_speed(15.0, Duration::zero()).straight(15'000));
  const RobotSetup setup = robot();
  Odometry odometry(setup.odometry(), setup.motion_sources());
  std::size_t sweeps = 0, failed = 0, settled_bytes = 0, peak_bytes = 0;
  double driven_m = 0.0;
  Pose T_odom_last;
  drive(scene, trajectory, setup, seconds{1000}, [&](const Sweep& sweep) {
    const OdometryEstimate estimate = odometry.process(sweep);
    failed += estimate.failed ? 1 : 0;
    driven_m += (estimate.T_odom_base.translation - T_odom_last.translation).norm();
    T_odom_last = estimate.T_odom_base;
    if (++sweeps % 100 == 0)
      peak_bytes = std::max(peak_bytes, resident_bytes());
    if (sweeps == kSettled)
      settled_bytes = peak_bytes;
  });
  std::printf("%zu sweeps, %zu failed, %.1f MB after %zu, %.1f MB at the most, %.1f m driven\n", sweeps, failed,
              1e-6 * static_cast<double>(settled_bytes), kSettled, 1e-6 * static_cast<double>(peak_bytes), driven_m);
  EXPECT_GE(sweeps, 9'990U);
  EXPECT_EQ(failed, 0U);
  EXPECT_GT(settled_bytes, 0U);
  EXPECT_LT(peak_bytes, kMostBytes);
  EXPECT_LT(peak_bytes, settled_bytes + kMostGrowth_bytes);
  EXPECT_NEAR(driven_m, 15'000, 0.002 * 15'000);
}

TEST(Soak, AThousandSweepsAtRestChangeNothing) {
  const sim::Trajectory trajectory(sim::Course{}.stand(seconds{101}));
  const sim::Scene scene = sim::street(100);
  const RobotSetup setup = robot();
  Odometry odometry(setup.odometry(), setup.motion_sources());
  std::vector<std::size_t> sizes;
  double farthest_m = 0.0, farthest_rad = 0.0;
  drive(scene, trajectory, setup, seconds{101}, [&](const Sweep& sweep) {
    const Pose T_odom_base = odometry.process(sweep).T_odom_base;
    sizes.push_back(odometry.map().fine().size());
    farthest_m = std::max(farthest_m, T_odom_base.translation.norm());
    farthest_rad = std::max(farthest_rad, angle_rad(T_odom_base.rotation));
  });
  ASSERT_GE(sizes.size(), 1000U);
  EXPECT_GT(sizes[1], 0U);
  for (std::size_t i = 1; i < sizes.size(); ++i)
    ASSERT_EQ(sizes[i], sizes[1]) << "sweep " << i;
  EXPECT_LT(farthest_m, 0.01);
  EXPECT_LT(farthest_rad, 0.05 * kRadPerDeg);
}

} // namespace
} // namespace locus::test
