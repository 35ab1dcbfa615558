// SPDX-License-Identifier: Apache-2.0
#include "config/lidar_metadata.hpp"

#include <cmath>
#include <fstream>

#include <gtest/gtest.h>

#include "support/temporary_file.hpp"

namespace locus {
namespace {

/// A sensor that is upside down and displaced, with its IMU 5 mm ahead of its own origin.
Config with_ouster(const test::TemporaryFile& file, const std::string& imu_profile = "LEGACY") {
  std::ofstream out{file.path()};
  const auto angles = [&](const char* key) {
    out << '"' << key << "\": [";
    for (int i = 0; i < 16; ++i)
      out << (i > 0 ? ", " : "") << i + 1;
    out << "], ";
  };
  out << "{";
  angles("beam_altitude_angles");
  angles("beam_azimuth_angles");
  out << R"("lidar_mode": "1024x10", "prod_line": "OS-1-16", "udp_port_lidar": 7577, "udp_port_imu": 7513,
    "imu_to_sensor_transform": [1, 0, 0, 5, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1],
    "data_format": {"pixels_per_column": 16, "columns_per_packet": 16, "columns_per_frame": 1024, "udp_profile_imu": ")"
      << imu_profile << "\"}}";
  Config config;
  config.lidars[0].metadata = file.path().string();
  config.lidars[0].T_base_lidar = {from_rpy_rad({0, std::acos(-1.0), 0}), {1, 0, 0}};
  return config;
}

TEST(LidarImus, AreMotionSourcesMountedWithTheirLidar) {
  const test::TemporaryFile file{"imu.json"};
  const auto config = with_lidar_metadata(with_ouster(file));
  ASSERT_TRUE(config) << config.error().front();
  ASSERT_EQ(config->motion_sources.size(), Config{}.motion_sources.size() + 1);
  const MotionSource& imu = config->motion_sources.back();
  EXPECT_EQ(imu.name, "front_imu");
  EXPECT_EQ(imu.kind, SourceKind::imu);
  EXPECT_TRUE(imu.of_lidar);
  EXPECT_TRUE(imu.topic.empty());
  EXPECT_TRUE(imu.T_base_source.translation.isApprox(Eigen::Vector3d{0.995, 0, 0}, 1e-9));
  EXPECT_EQ(config->lidars[0].imu_port, 7513);
  const auto again = with_lidar_metadata(*config);
  ASSERT_TRUE(again);
  EXPECT_EQ(*again, *config) << "as a recording of it is read";
}

TEST(LidarImus, RetainTheirPlaceInTheList) {
  const test::TemporaryFile file{"imu.json"};
  Config config = with_ouster(file);
  config.motion_sources.insert(config.motion_sources.begin(), {{"front_imu", SourceKind::imu, {}}, "", ""});
  const auto with = with_lidar_metadata(config);
  ASSERT_TRUE(with);
  EXPECT_EQ(with->motion_sources.size(), config.motion_sources.size());
  EXPECT_TRUE(with->motion_sources[0].of_lidar);
  EXPECT_FALSE(with->motion_sources[0].T_base_source == Pose{});

  config.motion_sources[0].kind = SourceKind::odometry;
  const auto refused = with_lidar_metadata(config);
  ASSERT_FALSE(refused);
  EXPECT_NE(
      refused.error().front().find("motion_sources.front_imu: this is the name of the inertial unit in lidar front"),
      std::string::npos);
}

/// An IMU that is published on a topic is not read a second time from packets.
TEST(LidarImus, WithATopicUseTheTopicOnly) {
  const test::TemporaryFile file{"imu.json"};
  Config config = with_ouster(file);
  config.motion_sources.insert(config.motion_sources.begin(), {{"front_imu", SourceKind::imu, {}}, "/os/imu", ""});
  const auto with = with_lidar_metadata(config);
  ASSERT_TRUE(with);
  EXPECT_EQ(with->motion_sources, config.motion_sources);
  EXPECT_EQ(with->lidars[0].imu_port, 0);
}

TEST(LidarPort, DefaultsToTheMetadata) {
  const test::TemporaryFile file{"port.json"};
  with_ouster(file);
  const auto port_of = [&](const std::string& keys) {
    const auto parsed =
        parse_config("lidars: [{name: front, model: Ouster, metadata: " + file.path().string() + keys + "}]", "test");
    EXPECT_TRUE(parsed) << parsed.error().front();
    const auto config = with_lidar_metadata(*parsed);
    EXPECT_TRUE(config) << config.error().front();
    EXPECT_EQ(*parse_config(print_config(*config), "printed"), [&] {
      Config without_imu = *config; // has no keys
      without_imu.lidars[0].imu_port = 0;
      without_imu.motion_sources.back().of_lidar = false;
      return without_imu;
    }());
    return config->lidars[0].port;
  };
  EXPECT_EQ(port_of(""), 7577);
  EXPECT_EQ(port_of(", port: 2368"), 2368);
  const auto velodyne = parse_config("lidars: [{name: front, port: 0}]", "test");
  EXPECT_FALSE(velodyne);
  EXPECT_EQ(parse_config("lidars: [{name: front}]", "test")->lidars[0].port, 2368);
}

TEST(LidarImus, AreAbsentIfTheLidarSendsNone) {
  const test::TemporaryFile file{"imu.json"};
  const auto off = with_lidar_metadata(with_ouster(file, "OFF"));
  ASSERT_TRUE(off);
  EXPECT_EQ(off->motion_sources.size(), Config{}.motion_sources.size());
  EXPECT_EQ(*with_lidar_metadata(Config{}), Config{}) << "a Velodyne";
}

TEST(LidarImus, UnreadableMetadataIsNamed) {
  Config config;
  config.lidars[0].ouster = true;
  const auto without = with_lidar_metadata(config);
  ASSERT_FALSE(without);
  EXPECT_TRUE(without.error().front().starts_with("lidars.front.metadata: names no file")) << without.error().front();
}

} // namespace
} // namespace locus
