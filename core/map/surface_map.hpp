// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "core/base/isa.hpp"
#include "core/base/pose.hpp"
#include "core/base/surface_point.hpp"
#include "core/map/surface_grid.hpp"

namespace locus {

/// Map of surfaces in voxels of two sizes: fine ones for accuracy, coarse ones for reach and for sparse surroundings.
/// Serves as the global map, of which the part around the robot is the submap (paper II-B.3), and, with a single sweep,
/// as the target of scan-to-scan. Memory is bounded and fixed at construction. One writer or many readers.
class SurfaceMap {
 public:
  static constexpr double kFineLeaf_m = 0.5;
  static constexpr int kFinePerCoarse = 3; ///< odd: no fine voxel lies in two coarse ones
  static constexpr double kCoarseLeaf_m = kFinePerCoarse * kFineLeaf_m;

  /// `of_one_sweep`: target of scan-to-scan, see SurfaceGrid.
  explicit SurfaceMap(std::size_t max_bytes, Isa isa = best_isa(), bool of_one_sweep = false);

  /// Inserts a sweep at T_map_base. Returns the share of its points that fell into empty voxels.
  double insert(std::span<const SurfacePoint> points_base, const Pose& T_map_base);
  void clear();

  /// Returns whether a point can be looked up: finite, and within the range of voxel indices.
  [[nodiscard]] bool reaches(const Eigen::Vector3d& point_m) const { return fine_.reaches(point_m); }

  /// Returns whether the fine voxel that contains a point holds points of the map.
  [[nodiscard]] bool is_occupied(const Eigen::Vector3d& point_m) const {
    return reaches(point_m) && fine_.find(fine_.index_of(point_m)) != nullptr;
  }

  /// Returns the coarse voxel that contains a fine one.
  [[nodiscard]] static VoxelIndex coarse_of(VoxelIndex fine) {
    const auto cell = [](std::int32_t i) {
      const std::int32_t moved = i + kFinePerCoarse / 2;
      return moved / kFinePerCoarse - (moved % kFinePerCoarse < 0 ? 1 : 0);
    };
    return {cell(fine.x), cell(fine.y), cell(fine.z)};
  }

  [[nodiscard]] const SurfaceGrid& fine() const { return fine_; }
  [[nodiscard]] const SurfaceGrid& coarse() const { return coarse_; }

 private:
  Isa isa_;
  SurfaceGrid fine_;
  SurfaceGrid coarse_;
};

} // namespace locus
