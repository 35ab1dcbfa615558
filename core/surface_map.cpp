// SPDX-License-Identifier: Apache-2.0
#include "core/surface_map.hpp"

#include <algorithm>

namespace locus {

namespace {

/// The coarse grid needs about a ninth of the voxels of the fine one where both see surfaces.
constexpr std::size_t kCoarseShare = 8;

/// Registration looks no farther than the lidars see.
constexpr double kSubmapRadius_m = 100.0;

} // namespace

SurfaceMap::SurfaceMap(std::size_t max_bytes)
    : fine_(kFineLeaf_m, max_bytes - max_bytes / kCoarseShare), coarse_(kCoarseLeaf_m, max_bytes / kCoarseShare) {}

double SurfaceMap::insert(std::span<const SurfacePoint> points_base, const Pose& T_map_base) {
  const Eigen::Matrix3d R = T_map_base.R();
  fine_.protect(T_map_base.translation, kSubmapRadius_m);
  coarse_.protect(T_map_base.translation, kSubmapRadius_m);
  points_map_.clear();
  for (const auto& [position_m, normal] : points_base)
    points_map_.push_back({R * position_m.cast<double>() + T_map_base.translation, R.cast<float>() * normal});
  const std::size_t fresh = fine_.insert(points_map_);
  coarse_.insert(points_map_);
  fine_.refresh();
  coarse_.refresh();
  return static_cast<double>(fresh) / static_cast<double>(std::max<std::size_t>(points_map_.size(), 1));
}

void SurfaceMap::clear() {
  fine_.clear();
  coarse_.clear();
}

} // namespace locus
