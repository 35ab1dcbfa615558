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

/// The map as surfaces in voxels of two sizes: the fine one for accuracy, the coarse one for reach and for sparse
/// places. Serves as the global map whose neighbourhood of the robot is the submap (paper II-B.3) and, holding one
/// sweep, as the target of scan-to-scan. Memory is bounded and fixed at construction. One writer or many readers.
class SurfaceMap {
 public:
  static constexpr double kFineLeaf_m = 0.5;
  static constexpr int kFinePerCoarse = 3; ///< odd: no fine voxel lies in two coarse ones
  static constexpr double kCoarseLeaf_m = kFinePerCoarse * kFineLeaf_m;

  explicit SurfaceMap(std::size_t max_bytes, Isa isa = best_isa());

  /// Takes in a sweep seen from T_map_base. Returns the share of its points that fell where nothing was.
  double insert(std::span<const SurfacePoint> points_base, const Pose& T_map_base);
  void clear();

  /// Whether a point can be looked up: finite, and no farther than voxels can be counted.
  [[nodiscard]] bool reaches(const Eigen::Vector3d& point_m) const { return fine_.reaches(point_m); }

  /// The coarse voxel that a fine one lies in.
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
