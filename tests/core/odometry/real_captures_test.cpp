// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <optional>
#include <string>
#include <vector>

#include "core/odometry/odometry.hpp"
#include "core/recording.hpp"

namespace locus::test {
namespace {

using std::chrono::milliseconds;

/// Captures of real sensors: lidar alone, no configuration.
class RealSensor : public testing::Test {
 protected:
  static std::optional<Recording> load(const std::string& name) { return Recording::real(name); }

  static std::vector<OdometryEstimate> estimates(const Recording& recording) {
    OdometryOptions options;
    options.threads = 1;
    Odometry odometry(options);
    std::vector<OdometryEstimate> result;
    SweepsOfRecording sweeps(recording, SweepOptions{});
    while (const Sweep* sweep = sweeps.next())
      result.push_back(odometry.process(*sweep));
    return result;
  }

  static double turned_deg(const OdometryEstimate& estimate) {
    return angle_rad(estimate.T_odom_base.rotation) / kRadPerDeg;
  }

  static void expect_still(const std::vector<OdometryEstimate>& estimates, double max_turned_deg) {
    double moved_m = 0.0, most_turned_deg = 0.0;
    for (const OdometryEstimate& estimate : estimates) {
      moved_m = std::max(moved_m, estimate.T_odom_base.translation.norm());
      most_turned_deg = std::max(most_turned_deg, turned_deg(estimate));
      EXPECT_FALSE(estimate.failed);
    }
    std::printf("%zu sweeps, moved %.1f mm, turned %.3f deg at the most\n", estimates.size(), 1e3 * moved_m,
                most_turned_deg);
    EXPECT_LT(moved_m, 0.02);
    EXPECT_LT(most_turned_deg, max_turned_deg);
  }
};

#define LOAD_OR_SKIP(recording, name)                                                                                  \
  const std::optional<Recording> recording = load(name);                                                               \
  if (!(recording))                                                                                                    \
  GTEST_SKIP() << "no real captures; set LOCUS_TEST_DATA"

TEST_F(RealSensor, CarTurnsRightAtFifteenMetresPerSecond) {
  LOAD_OR_SKIP(car, "hdl32e_moving_15mps");
  const std::vector<OdometryEstimate> run = estimates(*car);
  ASSERT_GE(run.size(), 5U);
  double path_m = 0.0;
  for (std::size_t i = 2; i < run.size(); ++i) {
    const double step_m = (run[i].T_odom_base.translation - run[i - 1].T_odom_base.translation).norm();
    std::printf("step %zu: %.2f m/s\n", i, step_m / to_seconds(run[i].stamp - run[i - 1].stamp));
    path_m += step_m;
    EXPECT_FALSE(run[i].failed);
  }
  const double elapsed_s = to_seconds(run.back().stamp - run[1].stamp);
  const Eigen::Quaterniond turn = run[1].T_odom_base.rotation.conjugate() * run.back().T_odom_base.rotation;
  const double yaw_dps = to_rpy_rad(turn).z() / kRadPerDeg / elapsed_s;
  std::printf("%.2f m/s, %.2f deg/s\n", path_m / elapsed_s, yaw_dps);
  EXPECT_NEAR(path_m / elapsed_s, 15.45, 0.35) << "GPS a second before: 14.8 to 15.2, and gaining";
  EXPECT_LT(yaw_dps, 0.0) << "GPS: the course goes from 158.3 to 159.8 deg";
  EXPECT_GT(yaw_dps, -3.0);
}

/// Estimates how far the scene has moved towards the lidar along x since the first sweep, without registration: the
/// shift that best aligns the histograms of x. Only points more than a metre above the lidar count, because upright
/// structures give the histograms their edges.
class ShiftAlongX {
 public:
  explicit ShiftAlongX(const Sweep& first) : first_(histogram_of(first)) {}

  double to(const Sweep& now) const {
    const std::vector<double> histogram = histogram_of(now);
    std::vector<double> agreement;
    for (int shift = -kReach; shift <= kReach; ++shift)
      agreement.push_back(agreement_of(histogram, shift));
    const auto best = std::max_element(agreement.begin() + 1, agreement.end() - 1);
    const double before = *(best - 1), after = *(best + 1); // a parabola through the peak: finer than a bin
    const double between = 0.5 * (before - after) / (before - 2 * *best + after);
    return kBin_m * (static_cast<double>(best - agreement.begin()) - kReach + between);
  }

 private:
  static constexpr double kBin_m = 0.05, kReach_m = 1.0, kFarthest_m = 40.0;
  static constexpr int kReach = static_cast<int>(kReach_m / kBin_m);
  static constexpr int kBins = static_cast<int>(2 * kFarthest_m / kBin_m);

  static std::vector<double> histogram_of(const Sweep& sweep) {
    std::vector<double> histogram(kBins);
    for (const SweepPoint& point : sweep.points) {
      const double x = static_cast<double>(point.position_base_m.x());
      if (point.position_base_m.z() > 1.0F && std::abs(x) < kFarthest_m)
        histogram[static_cast<std::size_t>((x + kFarthest_m) / kBin_m)] += 1.0;
    }
    return histogram;
  }

  [[nodiscard]] double agreement_of(const std::vector<double>& now, int shift) const {
    double sum = 0.0;
    for (int bin = kReach; bin < kBins - kReach; ++bin)
      sum += first_[static_cast<std::size_t>(bin)] * now[static_cast<std::size_t>(bin - shift)];
    return sum;
  }

  std::vector<double> first_;
};

/// The capture is labelled as a standing car. It stands for half a second and then pulls away: the raw points show it
/// without any registration, and the car ends a third of a metre ahead.
TEST_F(RealSensor, CarPullsAwayFromStandstill) {
  LOAD_OR_SKIP(car, "hdl32e_static_monterey");
  const std::vector<OdometryEstimate> run = estimates(*car);
  const std::vector<Sweep> sweeps = sweeps_of(*car, every_return());
  ASSERT_GE(run.size(), 17U);
  ASSERT_EQ(run.size(), sweeps.size());
  const ShiftAlongX shift(sweeps.front());
  for (std::size_t i = 0; i + 1 < run.size(); ++i) { // the last is no whole revolution
    const double moved_m = run[i].T_odom_base.translation.norm();
    const double shifted_m = shift.to(sweeps[i]);
    std::printf("%4.2f s: odometry %.3f m, %.3f deg; shift %.3f m\n", to_seconds(run[i].stamp - run[0].stamp), moved_m,
                turned_deg(run[i]), shifted_m);
    EXPECT_FALSE(run[i].failed);
    EXPECT_NEAR(moved_m, shifted_m, 0.04);
    if (run[i].stamp - run.front().stamp < milliseconds{500}) {
      EXPECT_LT(moved_m, 0.02);
      EXPECT_LT(turned_deg(run[i]), 0.1);
    }
  }
}

TEST_F(RealSensor, StaticVlp16ThatReportsAnotherModel) {
  LOAD_OR_SKIP(tripod, "vlp16_static_1200rpm_product21");
  std::vector<OdometryEstimate> run = estimates(*tripod);
  EXPECT_NEAR(static_cast<double>(run.size()), 50.4, 1.0);
  run.resize(std::min<std::size_t>(run.size(), 30)); // at rest for 1.5 s, then moved by 0.1 m
  expect_still(run, 0.1);
}

TEST_F(RealSensor, StaticVlp16WithGps) {
  LOAD_OR_SKIP(tripod, "vlp16_static_gps_pps");
  const std::vector<OdometryEstimate> run = estimates(*tripod);
  EXPECT_NEAR(static_cast<double>(run.size()), 3.9, 1.0);
  expect_still(run, 0.1);
}

} // namespace
} // namespace locus::test
