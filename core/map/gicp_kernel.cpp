// SPDX-License-Identifier: Apache-2.0
#include "core/map/gicp_kernel.hpp"

#include <array>
#include <cmath>

namespace locus {

namespace {

/// Terms that a point adds to the normal equations, in the order of summation.
enum Term : std::size_t {
  kHtt = 0,        ///< translation with translation: xx xy xz yy yz zz
  kHtr = kHtt + 6, ///< translation with rotation, row by row
  kHrr = kHtr + 9, ///< rotation with rotation: xx xy xz yy yz zz
  kBt = kHrr + 6,
  kBr = kBt + 3,
  kObserved = kBr + 3,    ///< along the axes of the pass and about those of the target
  kSides = kObserved + 6, ///< likewise
  kError = kSides + 6,
  kWeight,
  kInliers,
  kPlanes,
  kTerms
};

/// Points per chunk: their terms stay in the fastest cache.
constexpr std::size_t kChunk = 64;
constexpr std::size_t kLanes = 16;
using Terms = std::array<std::array<float, kChunk>, kTerms>;
using Lanes = std::array<float, kLanes>;
using Sums = std::array<Lanes, kTerms>;

/// Eq. 9 and the sums of eq. 10 in docs/estimator.md. Computes the terms of a chunk of points from `begin`. The
/// residual of a plane is r = n' (R p + t - mean), its gradient with respect to the pose g = (n, R p x n). Normals are
/// noisy, and a sum of g g' mistakes their noise for surfaces of every orientation: along a corridor it would tie the
/// robot to where the scan lines fell. The errors of the source point's own normal m are independent of n, so a sum of
/// m n' (kObserved) has no such part: the method of instrumental variables (Reiersol 1941). Where m is unknown, n n'
/// less the variance of n stands in for it. A shapeless correspondence is a ball.
[[gnu::always_inline]] inline void compute_terms(const Affine& T, const SourceBlock& source, const MatchBlock& match,
                                                 const Axes& axes, float width2, std::size_t begin, Terms& terms) {
  const auto [R, t] = T;
  const float r00 = R(0, 0), r01 = R(0, 1), r02 = R(0, 2), r10 = R(1, 0), r11 = R(1, 1), r12 = R(1, 2), r20 = R(2, 0),
              r21 = R(2, 1), r22 = R(2, 2), tx = t.x(), ty = t.y(), tz = t.z();
  for (std::size_t k = 0; k < kChunk; ++k) {
    const std::size_t i = begin + k;
    const float px = source.x_m[i], py = source.y_m[i], pz = source.z_m[i];
    const float x = r00 * px + r01 * py + r02 * pz;
    const float y = r10 * px + r11 * py + r12 * pz;
    const float z = r20 * px + r21 * py + r22 * pz;
    const float sx = source.normal_x[i], sy = source.normal_y[i], sz = source.normal_z[i];
    const float ox = r00 * sx + r01 * sy + r02 * sz;
    const float oy = r10 * sx + r11 * sy + r12 * sz;
    const float oz = r20 * sx + r21 * sy + r22 * sz;
    const float nx = match.normal_x[i], ny = match.normal_y[i], nz = match.normal_z[i];
    const float dx = x + tx - match.x_m[i];
    const float dy = y + ty - match.y_m[i];
    const float dz = z + tz - match.z_m[i];

    const float knows = ox * ox + oy * oy + oz * oz > 0.5F ? 1.0F : 0.0F;
    const float own = nx * ox + ny * oy + nz * oz < 0.0F ? -knows : knows;
    const float rest = 1.0F - knows;
    const float mx = own * ox + rest * nx, my = own * oy + rest * ny, mz = own * oz + rest * nz;
    const float cx = ny * mz - nz * my, cy = nz * mx - nx * mz, cz = nx * my - ny * mx;
    const float reach = source.along_m2[i] - kPointVariance_m2;
    const float s = 1.0F / (match.across_m2[i] + kPointVariance_m2 + reach * (cx * cx + cy * cy + cz * cz));
    const float planar = nx * nx + ny * ny + nz * nz > 0.5F ? match.found[i] : 0.0F;
    const float ball = match.found[i] - planar;

    const float r = nx * dx + ny * dy + nz * dz;
    const float r2 = s * (planar * r * r + ball * (dx * dx + dy * dy + dz * dz));
    const float root = width2 / (width2 + r2);
    const float w = s * root * root; // Geman-McClure
    const float wp = planar * w, wb = ball * w;

    const float gx = y * nz - z * ny, gy = z * nx - x * nz, gz = x * ny - y * nx; // x times n
    const float ax = wp * nx, ay = wp * ny, az = wp * nz;
    terms[kHtt + 0][k] = ax * nx + wb;
    terms[kHtt + 1][k] = ax * ny;
    terms[kHtt + 2][k] = ax * nz;
    terms[kHtt + 3][k] = ay * ny + wb;
    terms[kHtt + 4][k] = ay * nz;
    terms[kHtt + 5][k] = az * nz + wb;
    terms[kHtr + 0][k] = ax * gx;
    terms[kHtr + 1][k] = ax * gy + wb * z;
    terms[kHtr + 2][k] = ax * gz - wb * y;
    terms[kHtr + 3][k] = ay * gx - wb * z;
    terms[kHtr + 4][k] = ay * gy;
    terms[kHtr + 5][k] = ay * gz + wb * x;
    terms[kHtr + 6][k] = az * gx + wb * y;
    terms[kHtr + 7][k] = az * gy - wb * x;
    terms[kHtr + 8][k] = az * gz;
    const float tx_ = wp * gx, ty_ = wp * gy, tz_ = wp * gz;
    terms[kHrr + 0][k] = tx_ * gx + wb * (y * y + z * z);
    terms[kHrr + 1][k] = tx_ * gy - wb * x * y;
    terms[kHrr + 2][k] = tx_ * gz - wb * x * z;
    terms[kHrr + 3][k] = ty_ * gy + wb * (z * z + x * x);
    terms[kHrr + 4][k] = ty_ * gz - wb * y * z;
    terms[kHrr + 5][k] = tz_ * gz + wb * (x * x + y * y);
    terms[kBt + 0][k] = ax * r + wb * dx;
    terms[kBt + 1][k] = ay * r + wb * dy;
    terms[kBt + 2][k] = az * r + wb * dz;
    terms[kBr + 0][k] = tx_ * r + wb * (y * dz - z * dy);
    terms[kBr + 1][k] = ty_ * r + wb * (z * dx - x * dz);
    terms[kBr + 2][k] = tz_ * r + wb * (x * dy - y * dx);
    const float hx = y * mz - z * my, hy = z * mx - x * mz, hz = x * my - y * mx;
    const float noise = wp * rest * match.tilt_rad2[i];
    for (std::size_t side = 0; side < 3; ++side) {
      const float along_m = mx * axes[side][0] + my * axes[side][1] + mz * axes[side][2];
      const float along_n = nx * axes[side][0] + ny * axes[side][1] + nz * axes[side][2];
      terms[kObserved + side][k] = wp * along_m * along_n - noise + wb;
      terms[kSides + side][k] = wp * std::abs(along_m);
    }
    terms[kObserved + 3][k] = wp * gx * hx + (wb - noise) * (y * y + z * z);
    terms[kObserved + 4][k] = wp * gy * hy + (wb - noise) * (z * z + x * x);
    terms[kObserved + 5][k] = wp * gz * hz + (wb - noise) * (x * x + y * y);
    terms[kSides + 3][k] = wp * std::abs(hx);
    terms[kSides + 4][k] = wp * std::abs(hy);
    terms[kSides + 5][k] = wp * std::abs(hz);
    const float weight = match.found[i] * root * root;
    terms[kError][k] = weight * r2;
    terms[kWeight][k] = weight;
    terms[kInliers][k] = r2 < width2 ? match.found[i] : 0.0F;
    terms[kPlanes][k] = planar;
  }
}

[[gnu::always_inline]] inline void add_up(const Terms& terms, Sums& sums) {
  for (std::size_t term = 0; term < kTerms; ++term)
    for (std::size_t k = 0; k < kChunk; k += kLanes)
      for (std::size_t lane = 0; lane < kLanes; ++lane)
        sums[term][lane] += terms[term][k + lane];
}

[[gnu::always_inline]] inline void sum_block(const Affine& T, const SourceBlock& source, const MatchBlock& matches,
                                             const Axes& axes, float width2, Sums& sums, FitBlock& fit) {
  Terms terms;
  for (std::size_t begin = 0; begin < kGicpBlock; begin += kChunk) {
    compute_terms(T, source, matches, axes, width2, begin, terms);
    add_up(terms, sums);
    for (std::size_t k = 0; k < kChunk; ++k) {
      fit.error[begin + k] = terms[kError][k];
      fit.mapped[begin + k] = terms[kInliers][k];
    }
  }
}

/// Adds halves to halves: vectorised, whereas successive additions would wait for each other.
double total(Lanes lanes) {
  for (std::size_t half = kLanes / 2; half > 0; half /= 2)
    for (std::size_t lane = 0; lane < half; ++lane)
      lanes[lane] += lanes[lane + half];
  return static_cast<double>(lanes.front());
}

Eigen::Matrix3d symmetric(const Sums& sums, std::size_t first) {
  const auto at = [&](std::size_t term) { return total(sums[first + term]); };
  Eigen::Matrix3d m;
  m << at(0), at(1), at(2), at(1), at(3), at(4), at(2), at(4), at(5);
  return m;
}

Matrix6 matrix_of(const Sums& sums) {
  Matrix6 H;
  H.topLeftCorner<3, 3>() = symmetric(sums, kHtt);
  H.bottomRightCorner<3, 3>() = symmetric(sums, kHrr);
  for (int i = 0; i < 9; ++i)
    H(i / 3, 3 + i % 3) = H(3 + i % 3, i / 3) = total(sums[kHtr + static_cast<std::size_t>(i)]);
  return H;
}

NormalEquations equations_of(const Sums& sums) {
  NormalEquations result;
  result.H = matrix_of(sums);
  for (int i = 0; i < 6; ++i)
    result.b[i] = total(sums[kBt + static_cast<std::size_t>(i)]);
  for (int axis = 0; axis < 6; ++axis) {
    result.observed[axis] = total(sums[kObserved + static_cast<std::size_t>(axis)]);
    result.sides[axis] = total(sums[kSides + static_cast<std::size_t>(axis)]);
  }
  result.error = total(sums[kError]);
  result.weight = total(sums[kWeight]);
  result.inliers = static_cast<std::size_t>(total(sums[kInliers]));
  result.planes = static_cast<std::size_t>(total(sums[kPlanes]));
  return result;
}

/// Sums the terms of an H that has the information of unit normals; a shapeless correspondence has a third of it along
/// each axis.
[[gnu::always_inline]] inline Sums sum_gradients(const Eigen::Matrix3f& R, const SourceBlock& source,
                                                 const MatchBlock& match) {
  const float r00 = R(0, 0), r01 = R(0, 1), r02 = R(0, 2), r10 = R(1, 0), r11 = R(1, 1), r12 = R(1, 2), r20 = R(2, 0),
              r21 = R(2, 1), r22 = R(2, 2);
  Sums sums{};
  for (std::size_t begin = 0; begin < kGicpBlock; begin += kLanes) {
    for (std::size_t lane = 0; lane < kLanes; ++lane) {
      const std::size_t i = begin + lane;
      const float px = source.x_m[i], py = source.y_m[i], pz = source.z_m[i];
      const float x = r00 * px + r01 * py + r02 * pz;
      const float y = r10 * px + r11 * py + r12 * pz;
      const float z = r20 * px + r21 * py + r22 * pz;
      const float nx = match.normal_x[i], ny = match.normal_y[i], nz = match.normal_z[i];
      const float gx = y * nz - z * ny, gy = z * nx - x * nz, gz = x * ny - y * nx;
      const float s = nx * nx + ny * ny + nz * nz > 0.0F ? 0.0F : match.found[i] / 3.0F;
      sums[kHtt + 0][lane] += nx * nx + s;
      sums[kHtt + 1][lane] += nx * ny;
      sums[kHtt + 2][lane] += nx * nz;
      sums[kHtt + 3][lane] += ny * ny + s;
      sums[kHtt + 4][lane] += ny * nz;
      sums[kHtt + 5][lane] += nz * nz + s;
      sums[kHtr + 0][lane] += nx * gx;
      sums[kHtr + 1][lane] += nx * gy + s * z;
      sums[kHtr + 2][lane] += nx * gz - s * y;
      sums[kHtr + 3][lane] += ny * gx - s * z;
      sums[kHtr + 4][lane] += ny * gy;
      sums[kHtr + 5][lane] += ny * gz + s * x;
      sums[kHtr + 6][lane] += nz * gx + s * y;
      sums[kHtr + 7][lane] += nz * gy - s * x;
      sums[kHtr + 8][lane] += nz * gz;
      sums[kHrr + 0][lane] += gx * gx + s * (y * y + z * z);
      sums[kHrr + 1][lane] += gx * gy - s * x * y;
      sums[kHrr + 2][lane] += gx * gz - s * x * z;
      sums[kHrr + 3][lane] += gy * gy + s * (z * z + x * x);
      sums[kHrr + 4][lane] += gy * gz - s * y * z;
      sums[kHrr + 5][lane] += gz * gz + s * (x * x + y * y);
    }
  }
  return sums;
}

} // namespace

NormalEquations linearise(const GicpPass& pass, const SourceBlock& source, const MatchBlock& matches, Isa isa,
                          FitBlock& fit) {
  Sums sums{};
  const Affine T = pass.T_origin_source();
  run_as(isa, [&] { sum_block(T, source, matches, pass.axes, static_cast<float>(pass.width2), sums, fit); });
  return equations_of(sums);
}

Normals normals_of(const MatchBlock& matches, Isa isa) {
  enum : std::size_t { kXx, kXy, kXz, kYy, kYz, kZz, kFound, kSums };
  std::array<Lanes, kSums> sums;
  run_as(isa, [&] {
    std::array<Lanes, kSums> lanes{};
    for (std::size_t begin = 0; begin < kGicpBlock; begin += kLanes) {
      for (std::size_t lane = 0; lane < kLanes; ++lane) {
        const std::size_t i = begin + lane;
        const float x = matches.normal_x[i], y = matches.normal_y[i], z = matches.normal_z[i];
        lanes[kXx][lane] += x * x;
        lanes[kXy][lane] += x * y;
        lanes[kXz][lane] += x * z;
        lanes[kYy][lane] += y * y;
        lanes[kYz][lane] += y * z;
        lanes[kZz][lane] += z * z;
        lanes[kFound][lane] += matches.found[i];
      }
    }
    sums = lanes;
  });
  Normals normals;
  normals.points = total(sums[kFound]);
  normals.squares << total(sums[kXx]), total(sums[kXy]), total(sums[kXz]), total(sums[kXy]), total(sums[kYy]),
      total(sums[kYz]), total(sums[kXz]), total(sums[kYz]), total(sums[kZz]);
  const double shapeless = normals.points - normals.squares.trace();
  normals.squares.diagonal().array() += shapeless / 3.0;
  return normals;
}

Matrix6 gradients_of(const Eigen::Matrix3d& R_target_source, const SourceBlock& source, const MatchBlock& matches,
                     Isa isa) {
  const Eigen::Matrix3f R = R_target_source.cast<float>();
  Sums sums;
  run_as(isa, [&] { sums = sum_gradients(R, source, matches); });
  return matrix_of(sums);
}

} // namespace locus
