// SPDX-License-Identifier: Apache-2.0
#include "locus_replay/report_map.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <iterator>
#include <limits>
#include <string>
#include <unordered_set>

#include <nettle/base64.h>

#include "accuracy/voxel_key.hpp"
#include "pages/octahedral.hpp"

namespace locus::tools {
namespace {

constexpr auto kFineLeaf_m = static_cast<float>(SurfaceMap::kFineLeaf_m);

struct Tiles {
  float side_m = kFineLeaf_m;
  std::vector<SurfacePoint> surfaces;
};

Tiles thinned(std::span<const SurfacePoint> surfaces) {
  constexpr float kCoarser = 1.25F;
  Tiles tiles{kFineLeaf_m, {}};
  std::ranges::copy_if(surfaces, std::back_inserter(tiles.surfaces),
                       [](const SurfacePoint& surface) { return surface.position_m.allFinite(); });
  while (tiles.surfaces.size() > kMapTiles) {
    tiles.side_m *= kCoarser;
    std::unordered_set<std::uint64_t> used;
    std::erase_if(tiles.surfaces, [&](const SurfacePoint& surface) {
      return !used.insert(voxel_key(surface.position_m, tiles.side_m)).second;
    });
  }
  return tiles;
}

Eigen::Vector3f turned_to_viewer(const SurfacePoint& surface, std::span<const Eigen::Vector3f> viewpoints) {
  if (viewpoints.empty())
    return surface.normal;
  const auto nearest = std::ranges::min(
      viewpoints, {}, [&](const Eigen::Vector3f& v) { return (v - surface.position_m).squaredNorm(); });
  return (nearest - surface.position_m).dot(surface.normal) < 0.0F ? -surface.normal : surface.normal;
}

std::string base64(std::span<const std::uint8_t> bytes) {
  std::string text(BASE64_ENCODE_RAW_LENGTH(bytes.size()), '\0');
  base64_encode_raw(text.data(), bytes.size(), bytes.data());
  return text;
}

void append_int16(std::vector<std::uint8_t>& bytes, float value) {
  const auto bits = static_cast<std::uint16_t>(static_cast<std::int16_t>(std::lround(value)));
  bytes.push_back(static_cast<std::uint8_t>(bits & 0xFFU));
  bytes.push_back(static_cast<std::uint8_t>(bits >> 8U));
}

/// Returns the plane of the coarse map that contains the point.
const Surface* coarse_plane_under(const Eigen::Vector3d& point_m, const SurfaceGrid& coarse) {
  constexpr double kOnPlane_m = 0.1;
  const VoxelIndex index = coarse.index_of(point_m);
  const Surface* surface = coarse.find(index);
  if (surface == nullptr || !surface->planar())
    return nullptr;
  const Eigen::Vector3d on_plane_m = coarse.centre_of(index) + surface->mean_m.cast<double>();
  return std::abs(surface->normal.cast<double>().dot(point_m - on_plane_m)) < kOnPlane_m ? surface : nullptr;
}

} // namespace

std::vector<SurfacePoint> visible_surfaces(const SurfaceMap& map) {
  std::vector<SurfacePoint> surfaces;
  map.fine().for_each([&](const Eigen::Vector3d& mean_m, const Surface& fine) {
    const Surface* surface = fine.planar() ? &fine : coarse_plane_under(mean_m, map.coarse());
    if (surface != nullptr)
      surfaces.push_back({mean_m.cast<float>(), surface->normal});
  });
  return surfaces;
}

nlohmann::ordered_json map_tiles(std::span<const SurfacePoint> surfaces, std::span<const Eigen::Vector3f> viewpoints) {
  const Tiles tiles = thinned(surfaces);
  constexpr float kLargest = std::numeric_limits<float>::max();
  Eigen::Vector3f low = Eigen::Vector3f::Constant(kLargest), high = -low;
  for (const SurfacePoint& surface : tiles.surfaces) {
    low = low.cwiseMin(surface.position_m);
    high = high.cwiseMax(surface.position_m);
  }
  if (tiles.surfaces.empty())
    low = high = Eigen::Vector3f::Zero();
  const Eigen::Vector3f origin = (low + high) / 2.0F;
  constexpr float kFinestStep_m = 1e-3F;
  const float step_m = std::max(kFinestStep_m, (high - origin).maxCoeff() / std::numeric_limits<std::int16_t>::max());

  std::vector<std::uint8_t> bytes;
  bytes.reserve(8 * tiles.surfaces.size());
  for (const SurfacePoint& surface : tiles.surfaces) {
    for (const float steps : Eigen::Vector3f{(surface.position_m - origin) / step_m})
      append_int16(bytes, steps);
    std::ranges::copy(octahedral(turned_to_viewer(surface, viewpoints)), std::back_inserter(bytes));
  }
  return {{"tile_m", tiles.side_m},
          {"count", tiles.surfaces.size()},
          {"origin_m", {origin.x(), origin.y(), origin.z()}},
          {"step_m", step_m},
          {"data", base64(bytes)}};
}

} // namespace locus::tools
