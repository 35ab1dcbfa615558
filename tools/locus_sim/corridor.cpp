// SPDX-License-Identifier: Apache-2.0
#include "locus_sim/scene_builder.hpp"
#include "locus_sim/world.hpp"

namespace locus::sim {

World make_corridor(std::uint64_t) {
  constexpr double kLength_m = 100, kHalfWidth_m = 1.5, kCeiling_m = 2.8;
  constexpr std::uint8_t kPlaster = 65, kLino = 25, kDarkDoor = 4;
  const Eigen::Vector3d along{kLength_m, 0, 0}, across{0, 2 * kHalfWidth_m, 0}, up{0, 0, kCeiling_m};
  const Eigen::Vector3d begin{0, -kHalfWidth_m, 0};
  SceneBuilder build;
  build.rectangle(begin, along, across, kLino);
  build.rectangle(begin + up, along, across, kPlaster);
  build.rectangle(begin, along, up, kPlaster);
  build.rectangle(begin + across, along, up, kPlaster);
  build.rectangle(begin, across, up, kDarkDoor);
  build.rectangle(begin + along, across, up, kDarkDoor);
  World world{.scene = build.scene(),
              .roads = {},
              .ground_m = {},
              .terrain = {.height_m = 0.003, .tilt_rad = 0.003, .wavelength_m = 3.1},
              .max_speed_mps = 1.5};
  world.roads.add({{5, 0}, {kLength_m - 5, 0}});
  return world;
}

} // namespace locus::sim
