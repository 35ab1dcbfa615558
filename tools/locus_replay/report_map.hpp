// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include <Eigen/Core>
#include <nlohmann/json.hpp>

#include "core/map/surface_map.hpp"

namespace locus::tools {

/// What the report shows of the map: its planes, and what of finer voxels without a plane lies on a plane of the coarse
/// map, as a floor does that the lidar saw in rings far apart.
std::vector<SurfacePoint> visible_surfaces(const SurfaceMap& map);

/// Tiles that the page of the report paves the surfaces of the map with: eight bytes each, so at most 1.6 MB of text.
inline constexpr std::size_t kMapTiles = 150'000;

/// `{tile_m, count, origin_m, step_m, data}`, where `data` is Base64 of little-endian records: x y z as int16 in steps
/// from the origin, then the normal as two int8 (octahedral, 127 is 1). Where there are more surfaces than tiles, one
/// stands for all in a larger voxel. Normals point to the nearest viewpoint, so a room can be looked into from outside.
nlohmann::ordered_json map_tiles(std::span<const SurfacePoint> surfaces, std::span<const Eigen::Vector3f> viewpoints);

} // namespace locus::tools
