// SPDX-License-Identifier: Apache-2.0
#include "core/odometry/aged_scan.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <random>
#include <vector>

namespace locus {
namespace {

constexpr double kSweepLength_s = 0.1;
constexpr float kBin_s = 0.1F / 64; ///< points within a bin are not sorted
const Vector6 kScanTwist = (Vector6() << 1, 2, 3, 4, 5, 6).finished();

Sweep sweep_of_ages(const std::vector<float>& ages_s) {
  Sweep sweep;
  sweep.start = stamp_from_ns(1'000'000'000);
  sweep.end = sweep.start + from_seconds(kSweepLength_s);
  for (const float age_s : ages_s)
    sweep.points.push_back({Eigen::Vector3f::Zero(), Eigen::Vector3f::Zero(), age_s, 0, 0});
  sweep.registered = ages_s.size();
  return sweep;
}

/// Returns a scan in which the x of a point is its index in the sweep.
std::vector<SurfacePoint> numbered_scan(std::size_t count) {
  std::vector<SurfacePoint> scan;
  for (std::size_t i = 0; i < count; ++i)
    scan.push_back({{static_cast<float>(i), 0, 0}, Eigen::Vector3f::UnitZ()});
  return scan;
}
std::size_t number_of(const SurfacePoint& point) { return static_cast<std::size_t>(point.position_m.x()); }

std::vector<float> random_ages(std::size_t count) {
  std::mt19937 random{1};
  std::uniform_real_distribution<float> age_s{0.0F, static_cast<float>(kSweepLength_s)};
  std::vector<float> ages_s(count);
  std::ranges::generate(ages_s, [&] { return age_s(random); });
  return ages_s;
}

TEST(AgedScan, PointsAreSortedByAgeAndNoneIsLost) {
  const std::vector<float> ages_s = random_ages(700);
  AgedScan aged;
  const ElasticScan sorted = aged.sort(sweep_of_ages(ages_s), numbered_scan(700), kScanTwist);
  ASSERT_EQ(sorted.points.size(), 700U);
  std::vector<bool> seen(700);
  for (std::size_t i = 0; i < 700; ++i) {
    seen[number_of(sorted.points[i])] = true;
    if (i > 0) {
      EXPECT_GE(ages_s[number_of(sorted.points[i])], ages_s[number_of(sorted.points[i - 1])] - kBin_s);
    }
  }
  EXPECT_TRUE(std::ranges::all_of(seen, std::identity{}));
  EXPECT_EQ(sorted.twist_base, kScanTwist);
}

TEST(AgedScan, EachPointHasItsAge) {
  const std::vector<float> ages_s = random_ages(700);
  AgedScan aged;
  const ElasticScan sorted = aged.sort(sweep_of_ages(ages_s), numbered_scan(700), kScanTwist);
  ASSERT_EQ(sorted.age_s.size(), 700U);
  for (std::size_t i = 0; i < 700; ++i)
    EXPECT_EQ(sorted.age_s[i], ages_s[number_of(sorted.points[i])]);
}

TEST(AgedScan, PointsOfOneAgeRetainTheirOrder) {
  AgedScan aged;
  const ElasticScan sorted = aged.sort(sweep_of_ages(std::vector<float>(300, 0.02F)), numbered_scan(300), kScanTwist);
  for (std::size_t i = 0; i < 300; ++i)
    EXPECT_EQ(number_of(sorted.points[i]), i);
}

/// The points beyond are only for the map.
TEST(AgedScan, OnlyTheRegisteredPointsAreSorted) {
  Sweep sweep = sweep_of_ages(random_ages(700));
  sweep.registered = 100;
  AgedScan aged;
  const ElasticScan sorted = aged.sort(sweep, numbered_scan(700), kScanTwist);
  ASSERT_EQ(sorted.points.size(), 100U);
  EXPECT_EQ(sorted.age_s.size(), 100U);
  for (const SurfacePoint& point : sorted.points)
    EXPECT_LT(number_of(point), 100U);
}

TEST(AgedScan, ASmallerSweepLeavesNothingOfALargerOne) {
  AgedScan aged;
  aged.sort(sweep_of_ages(random_ages(700)), numbered_scan(700), kScanTwist);
  const ElasticScan sorted = aged.sort(sweep_of_ages({0.03F, 0.01F}), numbered_scan(2), kScanTwist);
  ASSERT_EQ(sorted.points.size(), 2U);
  EXPECT_EQ(number_of(sorted.points[0]), 1U);
  EXPECT_EQ(number_of(sorted.points[1]), 0U);
  EXPECT_EQ(std::vector(sorted.age_s.begin(), sorted.age_s.end()), (std::vector{0.01F, 0.03F}));
  EXPECT_TRUE(aged.sort(sweep_of_ages({}), {}, kScanTwist).points.empty());
}

/// Rounding may put a point a little outside its sweep; a window without length has no ages.
TEST(AgedScan, AgesOutsideTheSweepAreSortedToItsEnds) {
  AgedScan aged;
  const ElasticScan sorted = aged.sort(sweep_of_ages({0.2F, 0.05F, -0.01F}), numbered_scan(3), kScanTwist);
  EXPECT_EQ(number_of(sorted.points[0]), 2U);
  EXPECT_EQ(number_of(sorted.points[1]), 1U);
  EXPECT_EQ(number_of(sorted.points[2]), 0U);

  Sweep without_length = sweep_of_ages({0.0F, 0.0F});
  without_length.end = without_length.start;
  EXPECT_EQ(aged.sort(without_length, numbered_scan(2), kScanTwist).points.size(), 2U);
}

} // namespace
} // namespace locus
