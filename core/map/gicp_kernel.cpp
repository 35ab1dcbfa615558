// SPDX-License-Identifier: Apache-2.0
#include "core/map/gicp_kernel.hpp"

#include <array>

namespace locus {

namespace {

/// What a point adds to the normal equations, in the order in which they are summed up.
enum Term : std::size_t {
  kHtt = 0,        ///< translation with translation: xx xy xz yy yz zz
  kHtr = kHtt + 6, ///< translation with rotation, row by row
  kHrr = kHtr + 9, ///< rotation with rotation: xx xy xz yy yz zz
  kBt = kHrr + 6,
  kBr = kBt + 3,
  kError = kBr + 3,
  kWeight,
  kInliers,
  kPlanes,
  kTerms
};

/// So many points at a time: their terms stay in the fastest cache.
constexpr std::size_t kChunk = 64;
constexpr std::size_t kLanes = 16;
using Terms = std::array<std::array<float, kChunk>, kTerms>;
using Lanes = std::array<float, kLanes>;
using Sums = std::array<Lanes, kTerms>;

/// The terms of all points from `begin`: residual d = R p + t - mean, J = [I, -(R p)x] for a turn about the target's
/// axes.
///
/// The information M = (C_target + C_source)^-1 of two surfaces with normals n and m: the sum of the covariances is
/// alpha I - u n n' - v m m', inverted after Woodbury to (I + n e' + m f') / alpha. A side without a normal is a ball,
/// its u or v zero.
[[gnu::always_inline]] inline void take_terms(const Affine& T, const SourceBlock& source, const MatchBlock& match,
                                              float width2, std::size_t begin, Terms& terms) {
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
    const float mx = r00 * sx + r01 * sy + r02 * sz;
    const float my = r10 * sx + r11 * sy + r12 * sz;
    const float mz = r20 * sx + r21 * sy + r22 * sz;
    const float nx = match.normal_x[i], ny = match.normal_y[i], nz = match.normal_z[i];
    const float dx = x + tx - match.x_m[i];
    const float dy = y + ty - match.y_m[i];
    const float dz = z + tz - match.z_m[i];

    const float u = match.along_m2[i] - match.across_m2[i];
    const float v = source.along_m2[i] - kPointVariance_m2;
    const float share = 1.0F / (match.along_m2[i] + source.along_m2[i]); // 1 / alpha
    const float cx = ny * mz - nz * my, cy = nz * mx - nx * mz, cz = nx * my - ny * mx;
    const float uv = u * v * share;
    const float s = 1.0F / (match.across_m2[i] + kPointVariance_m2 + uv * (cx * cx + cy * cy + cz * cz));
    const float nn = s * (u - uv);
    const float mm = s * (v - uv);
    const float nm = s * uv * (nx * mx + ny * my + nz * mz);
    const float ex = nn * nx + nm * mx, ey = nn * ny + nm * my, ez = nn * nz + nm * mz;
    const float fx = nm * nx + mm * mx, fy = nm * ny + mm * my, fz = nm * nz + mm * mz;

    const float ed = ex * dx + ey * dy + ez * dz;
    const float fd = fx * dx + fy * dy + fz * dz;
    const float gx = share * (dx + nx * ed + mx * fd); // M d
    const float gy = share * (dy + ny * ed + my * fd);
    const float gz = share * (dz + nz * ed + mz * fd);
    const float r2 = dx * gx + dy * gy + dz * gz;
    const float root = width2 / (width2 + r2);
    const float w = match.found[i] * root * root; // Geman-McClure
    const float ws = w * share;
    const float xx = ws * (1.0F + nx * ex + mx * fx), xy = ws * (nx * ey + mx * fy), xz = ws * (nx * ez + mx * fz);
    const float yy = ws * (1.0F + ny * ey + my * fy), yz = ws * (ny * ez + my * fz);
    const float zz = ws * (1.0F + nz * ez + mz * fz);

    // w M [R p]x, negated
    const float ax = y * xz - z * xy, ay = z * xx - x * xz, az = x * xy - y * xx;
    const float bx = y * yz - z * yy, by = z * xy - x * yz, bz = x * yy - y * xy;
    const float hx = y * zz - z * yz, hy = z * xz - x * zz, hz = x * yz - y * xz;

    terms[kHtt + 0][k] = xx;
    terms[kHtt + 1][k] = xy;
    terms[kHtt + 2][k] = xz;
    terms[kHtt + 3][k] = yy;
    terms[kHtt + 4][k] = yz;
    terms[kHtt + 5][k] = zz;
    terms[kHtr + 0][k] = ax;
    terms[kHtr + 1][k] = ay;
    terms[kHtr + 2][k] = az;
    terms[kHtr + 3][k] = bx;
    terms[kHtr + 4][k] = by;
    terms[kHtr + 5][k] = bz;
    terms[kHtr + 6][k] = hx;
    terms[kHtr + 7][k] = hy;
    terms[kHtr + 8][k] = hz;
    terms[kHrr + 0][k] = y * hx - z * bx;
    terms[kHrr + 1][k] = y * hy - z * by;
    terms[kHrr + 2][k] = y * hz - z * bz;
    terms[kHrr + 3][k] = z * ay - x * hy;
    terms[kHrr + 4][k] = z * az - x * hz;
    terms[kHrr + 5][k] = x * bz - y * az;
    terms[kBt + 0][k] = w * gx;
    terms[kBt + 1][k] = w * gy;
    terms[kBt + 2][k] = w * gz;
    terms[kBr + 0][k] = w * (y * gz - z * gy);
    terms[kBr + 1][k] = w * (z * gx - x * gz);
    terms[kBr + 2][k] = w * (x * gy - y * gx);
    terms[kError][k] = w * r2;
    terms[kWeight][k] = w;
    terms[kInliers][k] = r2 < width2 ? match.found[i] : 0.0F;
    terms[kPlanes][k] = nx * nx + ny * ny + nz * nz > 0.5F ? match.found[i] : 0.0F;
  }
}

[[gnu::always_inline]] inline void add_up(const Terms& terms, Sums& sums) {
  for (std::size_t term = 0; term < kTerms; ++term)
    for (std::size_t k = 0; k < kChunk; k += kLanes)
      for (std::size_t lane = 0; lane < kLanes; ++lane)
        sums[term][lane] += terms[term][k + lane];
}

[[gnu::always_inline]] inline void sum_block(const Affine& T, const SourceBlock& source, const MatchBlock& matches,
                                             float width2, Sums& sums) {
  Terms terms;
  for (std::size_t begin = 0; begin < kGicpBlock; begin += kChunk) {
    take_terms(T, source, matches, width2, begin, terms);
    add_up(terms, sums);
  }
}

/// Halves added to halves: vector instructions, where additions one after the other would wait for each other.
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
  result.error = total(sums[kError]);
  result.weight = total(sums[kWeight]);
  result.inliers = static_cast<std::size_t>(total(sums[kInliers]));
  result.planes = static_cast<std::size_t>(total(sums[kPlanes]));
  return result;
}

/// Terms of an H whose information is that of unit normals; a shapeless correspondence has a third of it along each
/// axis.
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

NormalEquations linearise(const GicpPass& pass, const SourceBlock& source, const MatchBlock& matches, Isa isa) {
  Sums sums{};
  const Affine T = pass.T_origin_source();
  run_as(isa, [&] { sum_block(T, source, matches, static_cast<float>(pass.width2), sums); });
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
