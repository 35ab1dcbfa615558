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

/// One quantity of each point of a block: one array per quantity allows loops over points to be vectorised.
using PerPoint = std::array<float, kGicpBlock>;

/// Points of a sweep, relative to the origin of their own frame. Entries beyond the last point are zero.
struct SourceBlock {
  PerPoint x_m{}, y_m{}, z_m{};
  PerPoint scan_x_m{}, scan_y_m{}, scan_z_m{}; ///< as in the scan, de-skewed for its twist
  PerPoint younger_s{};                        ///< mean age of the block minus that of the point
  PerPoint normal_x{}, normal_y{}, normal_z{}; ///< zero if unreliable
  PerPoint along_m2{}; ///< variance along the surface; without a normal, that of the point itself
  std::size_t count = 0;
  double age_s = 0.0; ///< mean over the points

  /// `ages_s`: of each point; empty: all are zero.
  explicit SourceBlock(std::span<const SurfacePoint> points, std::span<const float> ages_s = {});

  /// Moves the points relative to one of mean age, for a base whose twist differs by `twist_change` (m/s, rad/s) from
  /// that of the scan. To first order.
  void deskew(const Vector6& twist_change);
};

/// Voxels that contain the points of a block.
struct Cells {
  std::array<std::int32_t, kGicpBlock> x, y, z;
  [[nodiscard]] VoxelIndex operator[](std::size_t i) const { return {x[i], y[i], z[i]}; }
};

/// Correspondences of a block: planes of the target, or Gaussians of voxels without a plane (shapeless).
struct MatchBlock {
  PerPoint x_m, y_m, z_m;                ///< mean, relative to GicpPass::origin_m
  PerPoint normal_x, normal_y, normal_z; ///< zero for a shapeless one
  PerPoint across_m2;                    ///< variance along the normal, or of a shapeless one along each axis
  PerPoint tilt_rad2;                    ///< variance of the normal; zero for a shapeless one
  PerPoint found;                        ///< 1, or 0 where there is no correspondence
  PerPoint unknown;                      ///< 1 in a voxel that is occupied, by a surface of unknown shape
  Cells fine;                            ///< voxels in which they were looked up
};

/// Strategy for finding correspondences in a pass.
enum class LookUp {
  reuse,  ///< those of the previous pass
  follow, ///< those of the previous pass if the point is still in its voxel, else as `here`
  here,   ///< plane of the voxel around the point, fine or else coarse
  around, ///< nearest plane of the 27 voxels around it, coarse or else fine
};

/// Three orthogonal directions.
using Axes = std::array<std::array<float, 3>, 3>;

/// Transform in single precision.
struct Affine {
  Eigen::Matrix3f R;
  Eigen::Vector3f t;
};

/// Pass over some of the points: finds their correspondences and sums the normal equations at T_target_source.
struct GicpPass {
  const SurfaceMap& target;
  Pose T_target_source;
  Eigen::Vector3d origin_m; ///< in the target, near the source: origin of the single-precision coordinates
  LookUp look_up;
  bool accepts_shapeless;      ///< voxels without a plane are used, too
  double max_correspondence_m; ///< gate, across the plane
  double width2;               ///< of the Geman-McClure kernel, in squared standard deviations
  Axes axes{};                 ///< of the surrounding surfaces, from the least to the best observed

  /// Returns the transform from the source to the target, relative to origin_m.
  [[nodiscard]] Affine T_origin_source() const {
    return {T_target_source.R().cast<float>(), (T_target_source.translation - origin_m).cast<float>()};
  }
};

/// Finds the correspondences of the points by the strategy of the pass, which must not be LookUp::reuse. Writes to
/// `matches` only; any thread.
void find(const GicpPass& pass, const SourceBlock& source, MatchBlock& matches, Isa isa);

} // namespace locus
