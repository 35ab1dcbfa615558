// SPDX-License-Identifier: Apache-2.0
#include "core/gicp_kernel.hpp"

#include <cmath>

namespace locus {

namespace {

/// Surfaces say nothing along themselves: a variance there that is large against every residual (Segal's 1 to epsilon).
constexpr double kAlongVariance_m2 = 1.0;
constexpr double kPointVariance_m2 = 0.02 * 0.02;

Match match_of(const SurfaceGrid& grid, VoxelIndex index, const Surface& surface) {
  const Eigen::Vector3d mean = grid.centre_of(index) + surface.mean_m.cast<double>();
  if (surface.planar())
    return {mean, surface.normal.cast<double>(), static_cast<double>(surface.variance_m2)};
  return {mean, Eigen::Vector3d::Zero(), static_cast<double>(surface.strewn_m2)};
}

bool serves(const Surface* surface, bool takes_shapeless) {
  return surface != nullptr && (surface->planar() || (takes_shapeless && surface->shapeless()));
}

/// The plane of the voxel around the point, in the fine grid if it has one, else in the coarse one.
Match find_here(const GicpPass& pass, const Eigen::Vector3d& point) {
  for (const SurfaceGrid* grid : {&pass.target.fine(), &pass.target.coarse()}) {
    const VoxelIndex index = grid->index_of(point);
    const Surface* surface = grid->find(index);
    if (!serves(surface, pass.takes_shapeless))
      continue;
    Match match = match_of(*grid, index, *surface);
    if (std::abs(match.normal.dot(point - match.mean_m)) < pass.max_correspondence_m)
      return match;
  }
  return {};
}

/// The one of the 27 voxels around whose mean is nearest, at most a voxel away.
Match nearest_around(const SurfaceGrid& grid, bool takes_shapeless, const Eigen::Vector3d& point) {
  const VoxelIndex centre = grid.index_of(point);
  Match nearest;
  double nearest_m2 = grid.leaf_m() * grid.leaf_m();
  for (int i = 0; i < 27; ++i) {
    const VoxelIndex index{centre.x + i % 3 - 1, centre.y + i / 3 % 3 - 1, centre.z + i / 9 - 1};
    const Surface* surface = grid.find(index);
    if (!serves(surface, takes_shapeless))
      continue;
    const Match match = match_of(grid, index, *surface);
    const double distance_m2 = (point - match.mean_m).squaredNorm();
    if (distance_m2 < nearest_m2) {
      nearest_m2 = distance_m2;
      nearest = match;
    }
  }
  return nearest;
}

/// Near the point: in the fine grid if there is one within reach, else in the coarse one.
Match find_around(const GicpPass& pass, const Eigen::Vector3d& point) {
  Match fine = nearest_around(pass.target.fine(), pass.takes_shapeless, point);
  return fine.variance_m2 > 0.0 ? fine : nearest_around(pass.target.coarse(), pass.takes_shapeless, point);
}

/// Inverse of across n n' + along (I - n n'), for a unit normal n.
Eigen::Matrix3d inverse_of_disc(const Eigen::Vector3d& n, double across_m2, double along_m2) {
  return Eigen::Matrix3d::Identity() / along_m2 + (1.0 / across_m2 - 1.0 / along_m2) * n * n.transpose();
}

/// (C_target + C_source)^-1. A source without a normal is an isotropic point. Two planes with covariance
/// I + (variance - 1) n n' along their normals n and m add up to 2 (I - u n n' - v m m'), inverted after Woodbury.
Eigen::Matrix3d information(const Match& match, const Eigen::Vector3d& source_normal) {
  const Eigen::Vector3d& n = match.normal;
  const Eigen::Vector3d& m = source_normal;
  if (n.isZero())
    return inverse_of_disc(m, match.variance_m2 + kPointVariance_m2,
                           match.variance_m2 + (m.isZero() ? kPointVariance_m2 : kAlongVariance_m2));
  if (m.isZero())
    return inverse_of_disc(n, match.variance_m2 + kPointVariance_m2, kAlongVariance_m2 + kPointVariance_m2);
  constexpr double kScale = 2.0 * kAlongVariance_m2;
  const double k_n = kScale / (kAlongVariance_m2 - match.variance_m2) - 1.0;
  const double k_m = kScale / (kAlongVariance_m2 - kPointVariance_m2) - 1.0;
  const double c = n.dot(m);
  const Eigen::Vector3d a = k_m * n + c * m;
  const Eigen::Vector3d b = c * n + k_n * m;
  const double share = 1.0 / (k_n * k_m - c * c);
  return (Eigen::Matrix3d::Identity() + share * (a * n.transpose() + b * m.transpose())) / kScale;
}

/// Takes in one point's share: residual d = R p + t - mean, J = [I, -(R p)x] for a turn about the target's axes.
[[gnu::always_inline]] inline void add_point(const Eigen::Vector3d& rotated, const Eigen::Vector3d& rotated_normal,
                                             const Eigen::Vector3d& translation, const Match& match, double width2,
                                             NormalEquations& sum) {
  const Eigen::Vector3d d = rotated + translation - match.mean_m;
  const Eigen::Matrix3d M = information(match, rotated_normal);
  const Eigen::Vector3d Md = M * d;
  const double r2 = d.dot(Md);
  const double root = width2 / (width2 + r2);
  const double w = root * root; // Geman-McClure

  const double x = w * rotated.x();
  const double y = w * rotated.y();
  const double z = w * rotated.z();
  Eigen::Matrix3d wMQ; // w M (R p)x
  wMQ.col(0) = z * M.col(1) - y * M.col(2);
  wMQ.col(1) = x * M.col(2) - z * M.col(0);
  wMQ.col(2) = y * M.col(0) - x * M.col(1);
  sum.H.topLeftCorner<3, 3>() += w * M;
  sum.H.topRightCorner<3, 3>() -= wMQ;
  for (int column = 0; column < 3; ++column)
    sum.H.block<3, 1>(3, 3 + column) -= rotated.cross(wMQ.col(column));
  sum.b.head<3>() += w * Md;
  sum.b.tail<3>() += w * rotated.cross(Md);
  sum.normals.noalias() += (w * match.normal) * match.normal.transpose();
  sum.error += w * r2;
  sum.weight += w;
  sum.inliers += r2 < width2 ? 1 : 0;
  sum.planes += match.normal.isZero() ? 0U : 1U;
}

Match find(const GicpPass& pass, const Eigen::Vector3d& point) {
  if (!pass.target.reaches(point))
    return {};
  return pass.look_up == LookUp::around ? find_around(pass, point) : find_here(pass, point);
}

[[gnu::always_inline]] inline NormalEquations sum_points(const GicpPass& pass, std::span<const SurfacePoint> points,
                                                         std::span<Match> matches) {
  NormalEquations sum;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Eigen::Vector3d rotated = pass.R * points[i].position_m.cast<double>();
    if (pass.look_up != LookUp::keep)
      matches[i] = find(pass, rotated + pass.t);
    if (matches[i].variance_m2 > 0.0)
      add_point(rotated, pass.R * points[i].normal.cast<double>(), pass.t, matches[i], pass.width2, sum);
  }
  return sum;
}

/// The same source for three instruction sets. Only these functions are compiled for more than the baseline, so no type
/// changes its layout.
NormalEquations sum_baseline(const GicpPass& pass, std::span<const SurfacePoint> points, std::span<Match> matches) {
  return sum_points(pass, points, matches);
}

#if defined(__x86_64__)
[[gnu::flatten, gnu::target("avx2,fma")]] NormalEquations
sum_avx2(const GicpPass& pass, std::span<const SurfacePoint> points, std::span<Match> matches) {
  return sum_points(pass, points, matches);
}

[[gnu::flatten, gnu::target("avx512f,avx512vl,avx512dq,fma")]] NormalEquations
sum_avx512(const GicpPass& pass, std::span<const SurfacePoint> points, std::span<Match> matches) {
  return sum_points(pass, points, matches);
}
#endif

} // namespace

NormalEquations linearise(const GicpPass& pass, std::span<const SurfacePoint> points, std::span<Match> matches,
                          Isa isa) {
#if defined(__x86_64__)
  if (isa == Isa::avx512)
    return sum_avx512(pass, points, matches);
  if (isa == Isa::avx2)
    return sum_avx2(pass, points, matches);
#endif
  static_cast<void>(isa);
  return sum_baseline(pass, points, matches);
}

} // namespace locus
