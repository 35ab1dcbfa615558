// SPDX-License-Identifier: Apache-2.0
#include "core/map/surface_map.hpp"

#include <algorithm>
#include <array>

namespace locus {

namespace {

/// Divisor of the memory for the coarse grid: it needs about a ninth of the voxels of the fine one for the same
/// surfaces.
constexpr std::size_t kCoarseShare = 8;

/// Radius of the submap: registration reaches no farther than the lidars.
constexpr double kSubmapRadius_m = 100.0;

template <class Real> using Figures = std::array<Real, SurfaceGrid::Points::kMost>;

/// Transforms (x, y, z) to R (x, y, z) + t.
template <class Real>
[[gnu::always_inline]] inline void move(const Eigen::Matrix<Real, 3, 3>& R, const Eigen::Matrix<Real, 3, 1>& t,
                                        Figures<Real>& x, Figures<Real>& y, Figures<Real>& z) {
  const Real r00 = R(0, 0), r01 = R(0, 1), r02 = R(0, 2), r10 = R(1, 0), r11 = R(1, 1), r12 = R(1, 2), r20 = R(2, 0),
             r21 = R(2, 1), r22 = R(2, 2), tx = t.x(), ty = t.y(), tz = t.z();
  for (std::size_t i = 0; i < x.size(); ++i) {
    const Real vx = x[i], vy = y[i], vz = z[i];
    x[i] = r00 * vx + r01 * vy + r02 * vz + tx;
    y[i] = r10 * vx + r11 * vy + r12 * vz + ty;
    z[i] = r20 * vx + r21 * vy + r22 * vz + tz;
  }
}

SurfaceGrid::Points in_map(std::span<const SurfacePoint> points_base, const Pose& T_map_base, Isa isa) {
  SurfaceGrid::Points points;
  for (const auto& [position_m, normal] : points_base) {
    const std::size_t i = points.count++;
    points.x_m[i] = static_cast<double>(position_m.x());
    points.y_m[i] = static_cast<double>(position_m.y());
    points.z_m[i] = static_cast<double>(position_m.z());
    points.normal_x[i] = normal.x();
    points.normal_y[i] = normal.y();
    points.normal_z[i] = normal.z();
  }
  const Eigen::Matrix3d R = T_map_base.R();
  run_as(isa, [&] {
    move<double>(R, T_map_base.translation, points.x_m, points.y_m, points.z_m);
    move<float>(R.cast<float>(), Eigen::Vector3f::Zero(), points.normal_x, points.normal_y, points.normal_z);
  });
  return points;
}

} // namespace

SurfaceMap::SurfaceMap(std::size_t max_bytes, Isa isa, bool of_one_sweep)
    : isa_(isa), fine_(kFineLeaf_m, max_bytes - max_bytes / kCoarseShare, isa, of_one_sweep),
      coarse_(kCoarseLeaf_m, max_bytes / kCoarseShare, isa, of_one_sweep) {}

double SurfaceMap::insert(std::span<const SurfacePoint> points_base, const Pose& T_map_base) {
  fine_.protect(T_map_base.translation, kSubmapRadius_m);
  coarse_.protect(T_map_base.translation, kSubmapRadius_m);
  std::size_t fresh = 0;
  for (std::span<const SurfacePoint> rest = points_base; !rest.empty();) {
    const std::span<const SurfacePoint> some = rest.first(std::min(rest.size(), SurfaceGrid::Points::kMost));
    const SurfaceGrid::Points points_map = in_map(some, T_map_base, isa_);
    fresh += fine_.insert(points_map);
    coarse_.insert(points_map);
    rest = rest.subspan(some.size());
  }
  fine_.refresh();
  coarse_.refresh();
  return static_cast<double>(fresh) / static_cast<double>(std::max<std::size_t>(points_base.size(), 1));
}

void SurfaceMap::clear() {
  fine_.clear();
  coarse_.clear();
}

} // namespace locus
