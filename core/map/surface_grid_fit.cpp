// SPDX-License-Identifier: Apache-2.0
// Fit of the surfaces to the points of their voxels.
#include <algorithm>
#include <array>
#include <cmath>

#include "core/base/principal_axes.hpp"
#include "core/map/surface_grid.hpp"

namespace locus {

namespace {

/// Radius of the disc that a point represents, or of the ball if its normal is unknown, as a share of the voxel.
constexpr float kDiscRadiusInLeaves = 0.5F;

/// Criteria for a plane: its points spread in two directions, by an absolute and by a relative measure (one scan line
/// spreads in one only), and little across it. Discs around the points always spread, so their limit across is milder.
constexpr float kMinSpreadInLeaves = 0.15F;
constexpr float kMinMiddleToGreatest = 0.05F;
constexpr float kMaxAcrossToMiddle = 0.05F;
constexpr float kMaxAcrossToMiddleOfDiscs = 0.15F;
constexpr float kMaxRoughness_m = 0.15F;

/// Least number of points that are judged by their positions alone.
constexpr float kEnoughPoints = 4.0F;

/// Least share of the points' own normals that must agree with the plane: where wall and floor meet, a few points of
/// one tilt the plane through the many of the other, and the tilt drags the map along with the scan lines.
constexpr float kMinAgreement = 0.8F;

/// Voxels fitted at a time: a loop over them is vectorised.
constexpr std::size_t kFitsAtOnce = 64;

using PerVoxel = std::array<float, kFitsAtOnce>;
using Symmetric = Symmetric3<float>;

/// Sums over the points of some voxels, and the resulting surfaces.
struct Fits {
  PerVoxel count, x, y, z, xx, xy, xz, yy, yz, zz; ///< sums over the points
  PerVoxel nxx, nxy, nxz, nyy, nyz, nzz;
  PerVoxel mean_x, mean_y, mean_z, normal_x, normal_y, normal_z, variance_m2, tilt_rad2, strewn_m2;
};

/// Returns -1 for a plane, else 0; masks, since conditions would be branches.
[[gnu::always_inline]] inline std::int32_t is_plane(const PrincipalAxes<float>& axes, float min_spread_m2,
                                                    float max_across_to_middle, float agreement, float normals) {
  return -(axes.middle > min_spread_m2) & -(axes.middle > kMinMiddleToGreatest * axes.greatest) &
         -(axes.least < max_across_to_middle * axes.middle) & -(axes.least < kMaxRoughness_m * kMaxRoughness_m) &
         -(agreement >= kMinAgreement * normals);
}

/// Returns v' m v.
[[gnu::always_inline]] inline float quadratic(const Symmetric& m, float x, float y, float z) {
  return m.xx * x * x + m.yy * y * y + m.zz * z * z + 2.0F * (m.xy * x * y + m.xz * x * z + m.yz * y * z);
}

[[gnu::always_inline]] inline void fit_all(Fits& voxels, float leaf_m) {
  const float min_spread_m2 = kMinSpreadInLeaves * kMinSpreadInLeaves * leaf_m * leaf_m;
  const float along_m2 = kDiscRadiusInLeaves * kDiscRadiusInLeaves * leaf_m * leaf_m;
  const float between_lines_m2 = leaf_m * leaf_m / 12.0F; // uniform in the voxel
  Fits f = voxels;                                        // output apart from input: vectorised
  for (std::size_t i = 0; i < kFitsAtOnce; ++i) {
    const float share = 1.0F / voxels.count[i];
    const float x = share * voxels.x[i], y = share * voxels.y[i], z = share * voxels.z[i];
    const Symmetric scatter{share * voxels.xx[i] - x * x, share * voxels.xy[i] - x * y, share * voxels.xz[i] - x * z,
                            share * voxels.yy[i] - y * y, share * voxels.yz[i] - y * z, share * voxels.zz[i] - z * z};
    const Symmetric normals{voxels.nxx[i], voxels.nxy[i], voxels.nxz[i], voxels.nyy[i], voxels.nyz[i], voxels.nzz[i]};
    const float known = normals.xx + normals.yy + normals.zz; // their number: they have unit length
    const float disc = share * (kPointVariance_m2 - along_m2);
    const PrincipalAxes<float> points = principal_axes<float>(scatter);
    const PrincipalAxes<float> discs =
        principal_axes<float>({scatter.xx + along_m2 + disc * normals.xx, scatter.xy + disc * normals.xy,
                               scatter.xz + disc * normals.xz, scatter.yy + along_m2 + disc * normals.yy,
                               scatter.yz + disc * normals.yz, scatter.zz + along_m2 + disc * normals.zz});
    const std::int32_t enough = -(voxels.count[i] >= kEnoughPoints);
    const std::int32_t by_points = enough & is_plane(points, min_spread_m2, kMaxAcrossToMiddle,
                                                     quadratic(normals, points.x, points.y, points.z), known);
    const std::int32_t by_discs =
        is_plane(discs, min_spread_m2, kMaxAcrossToMiddleOfDiscs, quadratic(normals, discs.x, discs.y, discs.z), known);
    const auto best = [=](float of_points, float of_discs) { return by_points != 0 ? of_points : of_discs; };
    const auto planar = static_cast<float>(-(by_points | by_discs)), strewn = static_cast<float>(-enough);
    const float least = std::max(best(points.least, discs.least), kPointVariance_m2);
    f.mean_x[i] = x;
    f.mean_y[i] = y;
    f.mean_z[i] = z;
    f.normal_x[i] = best(points.x, discs.x);
    f.normal_y[i] = best(points.y, discs.y);
    f.normal_z[i] = best(points.z, discs.z);
    f.variance_m2[i] = planar * least - (1.0F - planar);
    f.tilt_rad2[i] = planar * share * least / std::max(best(points.middle, discs.middle), kPointVariance_m2);
    f.strewn_m2[i] = strewn * ((scatter.xx + scatter.yy + scatter.zz) / 3.0F + between_lines_m2 + kPointVariance_m2) -
                     (1.0F - strewn);
  }
  voxels = f;
}

} // namespace

/// Fits the surfaces of at most kFitsAtOnce voxels.
void SurfaceGrid::fit(std::span<const std::uint32_t> slots) {
  Fits fits{};
  fits.count.fill(1.0F);
  for (std::size_t i = 0; i < slots.size(); ++i) {
    Moments& moments = moments_[slots[i]];
    const auto& sums = moments.sums;
    fits.count[i] = sums[kCount];
    fits.x[i] = sums[kX];
    fits.y[i] = sums[kY];
    fits.z[i] = sums[kZ];
    fits.xx[i] = sums[kXx];
    fits.xy[i] = sums[kXy];
    fits.xz[i] = sums[kXz];
    fits.yy[i] = sums[kYy];
    fits.yz[i] = sums[kYz];
    fits.zz[i] = sums[kZz];
    fits.nxx[i] = sums[kNxx];
    fits.nxy[i] = sums[kNxy];
    fits.nxz[i] = sums[kNxz];
    fits.nyy[i] = sums[kNyy];
    fits.nyz[i] = sums[kNyz];
    fits.nzz[i] = sums[kNzz];
    moments.touched = moments.fresh = false;
  }
  run_as(isa_, [&] { fit_all(fits, static_cast<float>(leaf_m_)); });
  for (std::size_t i = 0; i < slots.size(); ++i)
    voxels_[slots[i]].surface = {{fits.mean_x[i], fits.mean_y[i], fits.mean_z[i]},
                                 {fits.normal_x[i], fits.normal_y[i], fits.normal_z[i]},
                                 fits.variance_m2[i],
                                 fits.tilt_rad2[i],
                                 moments_[slots[i]].shaped ? fits.strewn_m2[i] : std::min(0.0F, fits.strewn_m2[i])};
}

void SurfaceGrid::refresh() {
  for (std::size_t begin = 0; begin < touched_.size(); begin += kFitsAtOnce)
    fit(std::span(touched_).subspan(begin, std::min(kFitsAtOnce, touched_.size() - begin)));
  touched_.clear();
}

} // namespace locus
