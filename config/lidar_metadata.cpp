// SPDX-License-Identifier: Apache-2.0
#include "config/lidar_metadata.hpp"

#include <algorithm>

#include <fmt/format.h>

#include "drivers/packet_decoder.hpp"

namespace locus {

Expected<Config, ConfigErrors> with_lidar_metadata(Config config) {
  for (LidarOptions& lidar : config.lidars) {
    if (!lidar.is_ouster())
      continue;
    const auto metadata = metadata_of(lidar);
    if (!metadata)
      return ConfigErrors{fmt::format("lidars.{}.metadata: {}", lidar.name, metadata.error())};
    if (lidar.port == 0)
      lidar.port = metadata->lidar_port;
    lidar.imu_port = metadata->imu_port;
    if (lidar.imu_port == 0)
      continue;
    const std::string name = lidar.name + "_imu";
    const Pose T_base_imu = lidar.T_base_lidar * metadata->T_sensor_imu;
    const auto known = std::ranges::find(config.motion_sources, name, &MotionSource::name);
    if (known == config.motion_sources.end()) {
      MotionSource source{{name, SourceKind::imu, {}}, "", ""};
      source.T_base_source = T_base_imu;
      source.of_lidar = true;
      config.motion_sources.push_back(source);
      continue;
    }
    if (known->kind != SourceKind::imu)
      return ConfigErrors{
          fmt::format("motion_sources.{}: this is the name of the inertial unit in lidar {}; rename the "
                      "source",
                      name, lidar.name)};
    if (!known->topic.empty()) { // published by a driver: reading the lidar's port would duplicate the samples
      lidar.imu_port = 0;
      continue;
    }
    known->of_lidar = true;
    if (known->T_base_source == Pose{})
      known->T_base_source = T_base_imu;
  }
  if (const auto problem = config.problem())
    return ConfigErrors{*problem};
  return config;
}

} // namespace locus
