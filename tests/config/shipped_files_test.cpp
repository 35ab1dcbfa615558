// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <fstream>
#include <iterator>

#include "config/config_yaml.hpp"
#include "yaml_tree.hpp"

namespace locus {
namespace {

std::string shipped(const std::string& name) { return LOCUS_CONFIG_DIR "/" + name; }

Config load_shipped(const std::string& name) {
  const auto config = load_config(shipped(name));
  if (config)
    return *config;
  for (const std::string& error : config.error())
    ADD_FAILURE() << error;
  return {};
}

std::vector<std::string> source_names(const Config& config) {
  std::vector<std::string> names;
  for (const MotionSourceOptions& source : config.motion_sources)
    names.push_back(source.name);
  return names;
}

/// Returns the options of the algorithm, without lidars and sources.
Config without_robot(Config config) {
  const Config defaults;
  config.lidars = defaults.lidars;
  config.motion_sources = defaults.motion_sources;
  return config;
}

double pitch_deg(const LidarOptions& lidar) { return to_rpy_rad(lidar.T_base_lidar.rotation).y() / kRadPerDeg; }

TEST(ShippedFiles, LocusdListsEveryKeyWithItsDefault) {
  std::ifstream file{shipped("locusd.yaml")};
  const std::string text{std::istreambuf_iterator<char>{file}, {}};
  EXPECT_EQ(test::leaves_of(text), test::leaves_of(print_config(Config{})));
  EXPECT_EQ(load_shipped("locusd.yaml"), Config{});
}

TEST(ShippedFiles, HuskyHasOneLidarLevelAndOneLookingDownAheadByThirtyDegrees) {
  const Config husky = load_shipped("husky.yaml");
  ASSERT_EQ(husky.lidars.size(), 2U);
  EXPECT_NEAR(pitch_deg(husky.lidars[0]), 0.0, 1e-9);
  EXPECT_NEAR(pitch_deg(husky.lidars[1]), 30.0, 1e-9);
  EXPECT_LT((husky.lidars[1].T_base_lidar.rotation * Eigen::Vector3d::UnitX()).z(), 0.0);
  EXPECT_EQ(source_names(husky), (std::vector<std::string>{"wio", "imu"}));
}

TEST(ShippedFiles, SpotHasOneLidarAndPrefersVisionOverLegsOverImu) {
  const Config spot = load_shipped("spot.yaml");
  ASSERT_EQ(spot.lidars.size(), 1U);
  EXPECT_EQ(source_names(spot), (std::vector<std::string>{"vio", "kio", "imu"}));
}

TEST(ShippedFiles, HuskyAndSpotUseTheDefaultAlgorithm) {
  EXPECT_EQ(without_robot(load_shipped("husky.yaml")), Config{});
  EXPECT_EQ(without_robot(load_shipped("spot.yaml")), Config{});
}

/// Settings for both robots in Section II of the paper.
Config paper_algorithm() {
  Config paper;
  paper.sweep.segment_filter.enabled = false;
  paper.sweep.random_filter = {true, 0.1};
  paper.odometry.fusion = Fusion::queue;
  paper.odometry.no_source_prior = NoSourcePrior::identity;
  paper.odometry.scan_to_scan_mode = ScanToScanMode::always;
  paper.odometry.map.keyframe_m = 1.0;
  paper.odometry.map.keyframe_deg = 30.0;
  return paper;
}

TEST(ShippedFiles, PaperHuskyIsTableFour) {
  Config paper = paper_algorithm();
  paper.sweep.voxel_filter = {true, 0.1};
  paper.odometry.scan_to_scan.max_iterations = 20;
  paper.odometry.scan_to_submap.max_iterations = 20;
  paper.odometry.threads = 4;
  const Config husky = load_shipped("paper-husky.yaml");
  EXPECT_EQ(without_robot(husky), paper);
  EXPECT_EQ(husky.lidars, load_shipped("husky.yaml").lidars);
  EXPECT_EQ(husky.motion_sources, load_shipped("husky.yaml").motion_sources);
}

TEST(ShippedFiles, PaperSpotIsTableFour) {
  Config paper = paper_algorithm();
  paper.sweep.voxel_filter.enabled = false;
  paper.odometry.scan_to_scan.max_iterations = 25;
  paper.odometry.scan_to_submap.max_iterations = 25;
  paper.odometry.threads = 1;
  const Config spot = load_shipped("paper-spot.yaml");
  EXPECT_EQ(without_robot(spot), paper);
  EXPECT_EQ(spot.lidars, load_shipped("spot.yaml").lidars);
  EXPECT_EQ(spot.motion_sources, load_shipped("spot.yaml").motion_sources);
}

} // namespace
} // namespace locus
