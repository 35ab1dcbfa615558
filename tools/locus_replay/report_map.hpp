// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include <Eigen/Core>
#include <nlohmann/json.hpp>

#include "core/map/surface_map.hpp"

namespace locus::tools {

/// Returns the surfaces of the map for the report: its planes, and finer voxels without a plane that lie on a plane of
/// the coarse map, such as a floor with sparse lidar rings.
std::vector<SurfacePoint> visible_surfaces(const SurfaceMap& map);

/// Number of tiles that represent the surfaces of the map: eight bytes each, so at most 1.6 MB of text.
inline constexpr std::size_t kMapTiles = 150'000;

/// Returns `{tile_m, count, origin_m, step_m, data}`, where `data` is Base64 of little-endian records: x y z as int16
/// in steps from the origin, then the normal as two int8 (octahedral, 127 is 1). With more surfaces than tiles, one
/// tile stands for all in a larger voxel. Normals point to the nearest viewpoint, so that rooms can be viewed from
/// outside.
nlohmann::ordered_json map_tiles(std::span<const SurfacePoint> surfaces, std::span<const Eigen::Vector3f> viewpoints);

} // namespace locus::tools
