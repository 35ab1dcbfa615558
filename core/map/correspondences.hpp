// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "core/base/isa.hpp"
#include "core/base/pose.hpp"
#include "core/map/registration.hpp"
#include "core/map/surface_map.hpp"

namespace locus {

/// One figure of each point of a block: one array per figure makes loops over points vector instructions.
using PerPoint = std::array<float, kGicpBlock>;

/// Points of a sweep, from the origin of their own frame. Places beyond the last point of the sweep hold zeros.
struct SourceBlock {
  PerPoint x_m{}, y_m{}, z_m{};
  PerPoint normal_x{}, normal_y{}, normal_z{}; ///< zero where there is none to be trusted
  PerPoint along_m2{}; ///< variance along the surface; that of the point itself without a normal
  std::size_t count = 0;

  explicit SourceBlock(std::span<const SurfacePoint> points);
};

/// Voxels that the points of a block fall into.
struct Cells {
  std::array<std::int32_t, kGicpBlock> x, y, z;
  [[nodiscard]] VoxelIndex operator[](std::size_t i) const { return {x[i], y[i], z[i]}; }
};

/// Their correspondences: planes of the target, or Gaussians of shapeless voxels.
struct MatchBlock {
  PerPoint x_m, y_m, z_m;                ///< mean, from GicpPass::origin_m
  PerPoint normal_x, normal_y, normal_z; ///< zero for a shapeless one
  PerPoint across_m2, along_m2;          ///< variances; equal for a shapeless one
  PerPoint found;                        ///< 1, or 0 where there is no correspondence
  Cells fine;                            ///< where they were looked up
};

/// How correspondences come about in a pass.
enum class LookUp {
  keep,   ///< those of the pass before
  follow, ///< those of the pass before where the point is still in its voxel, else as `here`
  here,   ///< the plane of the voxel around the point, fine or else coarse
  around, ///< the nearest plane of the 27 voxels around it, coarse or else fine
};

/// Three directions at right angles.
using Axes = std::array<std::array<float, 3>, 3>;

/// Transform in single precision.
struct Affine {
  Eigen::Matrix3f R;
  Eigen::Vector3f t;
};

/// One pass over some of the points: finds their correspondences and sums the normal equations at T_target_source.
struct GicpPass {
  const SurfaceMap& target;
  Pose T_target_source;
  Eigen::Vector3d origin_m; ///< in the target, near the source: single precision counts from here
  LookUp look_up;
  bool takes_shapeless;        ///< voxels without a plane serve, too
  double max_correspondence_m; ///< across the plane
  double width2;               ///< of Geman-McClure, squared standard deviations
  Axes axes{};                 ///< of the surfaces around, from the least to the most seen

  /// From the source to the target about origin_m.
  [[nodiscard]] Affine T_origin_source() const {
    return {T_target_source.R().cast<float>(), (T_target_source.translation - origin_m).cast<float>()};
  }
};

/// Finds the correspondences of the points as the pass says, which is not to keep them. Pure but for `matches`; any
/// thread.
void find(const GicpPass& pass, const SourceBlock& source, MatchBlock& matches, Isa isa);

} // namespace locus
