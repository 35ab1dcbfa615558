// SPDX-License-Identifier: Apache-2.0
#include "core/gicp_kernel.hpp"

#include <cmath>
#include <numeric>
#include <span>

namespace locus {

namespace {

/// A surface of the target says nothing along itself: a variance there that is large against every residual (Segal's 1
/// to epsilon).
constexpr float kAlongVariance_m2 = 100.0F;

/// A point of the source reaches no farther along its surface than the arc it stands for. Were it as wide as the
/// target, a normal wrong by one degree would cost the point its weight, and the few luckiest normals would decide.
constexpr float kAlongSourceVariance_m2 = 0.1F * 0.1F;

/// Points farther than this from the origin have no counterpart: no lidar sees so far, and single precision counts
/// there in tenths of a millimetre.
constexpr float kMaxDistance_m = 1000.0F;

/// Stands in for a point that is not a number: it would spoil the sums even with no weight.
const SurfacePoint kOutOfReach{Eigen::Vector3f::Constant(1e6F * kMaxDistance_m), Eigen::Vector3f::Zero()};

/// Transform in single precision, about GicpPass::origin_m on the side of the target.
struct Affine {
  Eigen::Matrix3f R;
  Eigen::Vector3f t;
};

Affine about_origin(const GicpPass& pass) {
  return {pass.T_target_source.R().cast<float>(), (pass.T_target_source.translation - pass.origin_m).cast<float>()};
}

/// A surface of the target, where it lies and how it serves a point.
struct Counterpart {
  const Surface* surface = nullptr;
  Eigen::Vector3f mean_m = Eigen::Vector3f::Zero(); ///< from the origin
};

bool serves(const Surface* surface, bool takes_shapeless) {
  return surface != nullptr && (surface->planar() || (takes_shapeless && surface->shapeless()));
}

Counterpart at(const GicpPass& pass, const SurfaceGrid& grid, VoxelIndex index, const Surface* surface) {
  if (!serves(surface, pass.takes_shapeless))
    return {};
  return {surface, (grid.centre_of(index) - pass.origin_m).cast<float>() + surface->mean_m};
}

/// The one of the 27 voxels around whose mean is nearest, at most a voxel away.
Counterpart nearest_around(const GicpPass& pass, const SurfaceGrid& grid, const Eigen::Vector3f& point) {
  const VoxelIndex centre = grid.index_of(pass.origin_m + point.cast<double>());
  Counterpart nearest;
  auto nearest_m2 = static_cast<float>(grid.leaf_m() * grid.leaf_m());
  for (int i = 0; i < 27; ++i) {
    const VoxelIndex index{centre.x + i % 3 - 1, centre.y + i / 3 % 3 - 1, centre.z + i / 9 - 1};
    const Counterpart match = at(pass, grid, index, grid.find(index));
    const float distance_m2 = (point - match.mean_m).squaredNorm();
    if (match.surface != nullptr && distance_m2 < nearest_m2) {
      nearest_m2 = distance_m2;
      nearest = match;
    }
  }
  return nearest;
}

void put(const Counterpart& match, std::size_t i, MatchBlock& matches) {
  const bool found = match.surface != nullptr;
  const bool planar = found && match.surface->planar();
  const Eigen::Vector3f normal = planar ? match.surface->normal : Eigen::Vector3f::Zero();
  matches.x_m[i] = match.mean_m.x();
  matches.y_m[i] = match.mean_m.y();
  matches.z_m[i] = match.mean_m.z();
  matches.normal_x[i] = normal.x();
  matches.normal_y[i] = normal.y();
  matches.normal_z[i] = normal.z();
  matches.across_m2[i] = planar ? match.surface->variance_m2 : found ? match.surface->strewn_m2 : 1.0F;
  matches.along_m2[i] = planar ? kAlongVariance_m2 : matches.across_m2[i];
  matches.found[i] = found ? 1.0F : 0.0F;
}

/// Where the points of a block lie in the target, from the origin.
struct Placed {
  PerPoint x_m, y_m, z_m;
  [[nodiscard]] Eigen::Vector3f operator[](std::size_t i) const { return {x_m[i], y_m[i], z_m[i]}; }
};

using Places = std::array<std::uint32_t, kGicpBlock>;

/// SurfaceGrid::index_of for all points of a block, in single precision; points out of reach go anywhere.
[[gnu::always_inline]] inline void index_all(const SurfaceGrid& grid, const Eigen::Vector3d& origin_m,
                                             const Placed& points, Cells& cells) {
  constexpr float kMost = 2.0F * kMaxDistance_m / static_cast<float>(SurfaceMap::kFineLeaf_m);
  const auto per_m = static_cast<float>(1.0 / grid.leaf_m());
  const auto index = [&](double from_m, const PerPoint& at_m, auto& cell) {
    const double from_cells = from_m / grid.leaf_m() + 0.5;
    const auto whole = static_cast<std::int32_t>(std::floor(from_cells));
    const auto part = static_cast<float>(from_cells - static_cast<double>(whole));
    for (std::size_t i = 0; i < kGicpBlock; ++i) {
      const float cells_on = std::clamp(at_m[i] * per_m + part, -kMost, kMost);
      const auto truncated = static_cast<std::int32_t>(cells_on);
      cell[i] = whole + truncated - static_cast<std::int32_t>(cells_on < static_cast<float>(truncated));
    }
  };
  index(origin_m.x(), points.x_m, cells.x);
  index(origin_m.y(), points.y_m, cells.y);
  index(origin_m.z(), points.z_m, cells.z);
}

bool is_near(const Eigen::Vector3f& point) { return (point.array().abs() < kMaxDistance_m).all(); }

/// Lists the points that are to be looked up and gives back how many they are. To the others belongs what is there.
std::size_t list_open(const GicpPass& pass, const Placed& points, std::size_t count, const Cells& fine,
                      MatchBlock& matches, Places& open) {
  std::size_t listed = 0;
  for (std::size_t i = 0; i < count; ++i) {
    if (pass.look_up == LookUp::follow && fine[i] == matches.fine[i])
      continue;
    put({}, i, matches);
    open[listed] = static_cast<std::uint32_t>(i);
    listed += is_near(points[i]) ? 1U : 0U;
  }
  return listed;
}

/// The plane of the voxel around each point, in the fine grid if it has one, else in the coarse one.
void find_here(const GicpPass& pass, const Placed& points, std::size_t count, MatchBlock& matches, Isa isa) {
  Cells fine, coarse;
  run_as(isa, [&] {
    index_all(pass.target.fine(), pass.origin_m, points, fine);
    index_all(pass.target.coarse(), pass.origin_m, points, coarse);
  });
  Places open; // of points still without a counterpart
  count = list_open(pass, points, count, fine, matches, open);
  matches.fine = fine;
  std::array<VoxelIndex, kGicpBlock> index;
  std::array<const Surface*, kGicpBlock> surface;
  const auto reach_m = static_cast<float>(pass.max_correspondence_m);
  for (const bool in_fine : {true, false}) {
    const SurfaceGrid& grid = in_fine ? pass.target.fine() : pass.target.coarse();
    for (std::size_t k = 0; k < count; ++k)
      index[k] = in_fine ? fine[open[k]] : coarse[open[k]];
    grid.find(std::span(index).first(count), std::span(surface).first(count));
    std::size_t left = 0;
    for (std::size_t k = 0; k < count; ++k) {
      const std::uint32_t i = open[k];
      const Counterpart match = at(pass, grid, index[k], surface[k]);
      const bool near =
          match.surface != nullptr &&
          (!match.surface->planar() || std::abs(match.surface->normal.dot(points[i] - match.mean_m)) < reach_m);
      if (near)
        put(match, i, matches);
      open[left] = i;
      left += near ? 0U : 1U;
    }
    count = left;
  }
}

/// Near each point: in the coarse grid if there is one within reach, else in the fine one. From afar the nearest of the
/// small voxels is rarely the right one.
void find_around(const GicpPass& pass, const Placed& points, std::size_t count, MatchBlock& matches) {
  for (std::size_t i = 0; i < count; ++i) {
    put({}, i, matches);
    if (!is_near(points[i]))
      continue;
    Counterpart match = nearest_around(pass, pass.target.coarse(), points[i]);
    if (match.surface == nullptr)
      match = nearest_around(pass, pass.target.fine(), points[i]);
    put(match, i, matches);
  }
}

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
using Sums = std::array<std::array<float, kLanes>, kTerms>;

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

NormalEquations equations_of(const Sums& sums) {
  const auto total = [&sums](std::size_t term) {
    double sum = 0.0;
    for (const float lane : sums[term])
      sum += static_cast<double>(lane);
    return sum;
  };
  const auto symmetric = [&total](std::size_t first) {
    Eigen::Matrix3d m;
    m << total(first), total(first + 1), total(first + 2), total(first + 1), total(first + 3), total(first + 4),
        total(first + 2), total(first + 4), total(first + 5);
    return m;
  };
  NormalEquations result;
  result.H.topLeftCorner<3, 3>() = symmetric(kHtt);
  result.H.bottomRightCorner<3, 3>() = symmetric(kHrr);
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column)
      result.H(row, 3 + column) = result.H(3 + column, row) =
          total(kHtr + 3U * static_cast<std::size_t>(row) + static_cast<std::size_t>(column));
    result.b[row] = total(kBt + static_cast<std::size_t>(row));
    result.b[3 + row] = total(kBr + static_cast<std::size_t>(row));
  }
  result.error = total(kError);
  result.weight = total(kWeight);
  result.inliers = static_cast<std::size_t>(total(kInliers));
  result.planes = static_cast<std::size_t>(total(kPlanes));
  return result;
}

} // namespace

SourceBlock::SourceBlock(std::span<const SurfacePoint> points) : count(points.size()) {
  along_m2.fill(kPointVariance_m2);
  for (std::size_t i = 0; i < points.size(); ++i) {
    const bool finite = points[i].position_m.allFinite() && points[i].normal.allFinite();
    const auto& [position_m, normal] = finite ? points[i] : kOutOfReach;
    x_m[i] = position_m.x();
    y_m[i] = position_m.y();
    z_m[i] = position_m.z();
    normal_x[i] = normal.x();
    normal_y[i] = normal.y();
    normal_z[i] = normal.z();
    along_m2[i] = normal.isZero() ? kPointVariance_m2 : kAlongSourceVariance_m2;
  }
}

void find(const GicpPass& pass, const SourceBlock& source, MatchBlock& matches, Isa isa) {
  const auto [R, t] = about_origin(pass);
  Placed points;
  for (std::size_t i = 0; i < kGicpBlock; ++i) {
    points.x_m[i] = R(0, 0) * source.x_m[i] + R(0, 1) * source.y_m[i] + R(0, 2) * source.z_m[i] + t.x();
    points.y_m[i] = R(1, 0) * source.x_m[i] + R(1, 1) * source.y_m[i] + R(1, 2) * source.z_m[i] + t.y();
    points.z_m[i] = R(2, 0) * source.x_m[i] + R(2, 1) * source.y_m[i] + R(2, 2) * source.z_m[i] + t.z();
  }
  for (std::size_t i = source.count; i < kGicpBlock; ++i)
    put({}, i, matches);
  if (pass.look_up == LookUp::around)
    find_around(pass, points, source.count, matches);
  else
    find_here(pass, points, source.count, matches, isa);
}

void straighten(const WeakDirections& weak, MatchBlock& matches) {
  constexpr float kNormalError = 0.1F; ///< three standard deviations of a normal from a handful of returns
  for (const Eigen::Vector3f& along : std::span(weak.unit).first(weak.count)) {
    for (std::size_t i = 0; i < kGicpBlock; ++i) {
      const float leans =
          matches.normal_x[i] * along.x() + matches.normal_y[i] * along.y() + matches.normal_z[i] * along.z();
      const float taken = std::abs(leans) < kNormalError ? leans : 0.0F;
      matches.normal_x[i] -= taken * along.x();
      matches.normal_y[i] -= taken * along.y();
      matches.normal_z[i] -= taken * along.z();
    }
  }
}

NormalEquations linearise(const GicpPass& pass, const SourceBlock& source, const MatchBlock& matches, Isa isa) {
  Sums sums{};
  const Affine T = about_origin(pass);
  run_as(isa, [&] { sum_block(T, source, matches, static_cast<float>(pass.width2), sums); });
  return equations_of(sums);
}

Normals normals_of(const MatchBlock& matches) {
  enum : std::size_t { kXx, kXy, kXz, kYy, kYz, kZz, kFound, kSums };
  std::array<std::array<float, kLanes>, kSums> sums{};
  for (std::size_t i = 0; i < kGicpBlock; i += kLanes) {
    for (std::size_t lane = 0; lane < kLanes; ++lane) {
      const float x = matches.normal_x[i + lane], y = matches.normal_y[i + lane], z = matches.normal_z[i + lane];
      sums[kXx][lane] += x * x;
      sums[kXy][lane] += x * y;
      sums[kXz][lane] += x * z;
      sums[kYy][lane] += y * y;
      sums[kYz][lane] += y * z;
      sums[kZz][lane] += z * z;
      sums[kFound][lane] += matches.found[i + lane];
    }
  }
  const auto total = [&sums](std::size_t sum) {
    return static_cast<double>(std::accumulate(sums[sum].begin(), sums[sum].end(), 0.0F));
  };
  Normals normals;
  normals.points = total(kFound);
  normals.squares << total(kXx), total(kXy), total(kXz), total(kXy), total(kYy), total(kYz), total(kXz), total(kYz),
      total(kZz);
  const double shapeless = normals.points - normals.squares.trace();
  normals.squares.diagonal().array() += shapeless / 3.0;
  return normals;
}

Matrix6 gradients_of(const Eigen::Matrix3d& R_target_source, const SourceBlock& source, const MatchBlock& matches) {
  using Row = Eigen::Array<float, 1, kGicpBlock>;
  const auto row = [](const PerPoint& figures) { return Eigen::Map<const Row>(figures.data()); };
  const Eigen::Matrix3f R = R_target_source.cast<float>();
  Eigen::Matrix<float, 3, kGicpBlock> p;
  for (int axis = 0; axis < 3; ++axis)
    p.row(axis) = R(axis, 0) * row(source.x_m) + R(axis, 1) * row(source.y_m) + R(axis, 2) * row(source.z_m);
  const auto x = p.row(0).array(), y = p.row(1).array(), z = p.row(2).array();
  const auto nx = row(matches.normal_x), ny = row(matches.normal_y), nz = row(matches.normal_z);
  Eigen::Matrix<float, 6, kGicpBlock> gradients;
  gradients << nx, ny, nz, y * nz - z * ny, z * nx - x * nz, x * ny - y * nx;
  Matrix6 sum = (gradients * gradients.transpose()).cast<double>();
  for (std::size_t i = 0; i < source.count; ++i) {
    const auto column = static_cast<Eigen::Index>(i);
    if (matches.found[i] == 0.0F || !gradients.col(column).head<3>().isZero(0.0F))
      continue;
    Eigen::Matrix<double, 6, 3> shapeless;
    shapeless << Eigen::Matrix3d::Identity(), skew(p.col(column).cast<double>());
    sum += shapeless * shapeless.transpose() / 3.0;
  }
  return sum;
}

} // namespace locus
