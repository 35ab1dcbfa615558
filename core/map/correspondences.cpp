// SPDX-License-Identifier: Apache-2.0
#include "core/map/correspondences.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace locus {

namespace {

/// Variance of a source point along its surface: that of the arc which it represents. If it were that of the target, a
/// normal wrong by one degree would cost the point its weight, and the few luckiest normals would decide.
constexpr float kAlongSourceVariance_m2 = 0.1F * 0.1F;

/// Largest distance from the origin of a point with a correspondence: beyond the range of any lidar, and the resolution
/// of single precision there is a tenth of a millimetre.
constexpr float kMaxDistance_m = 1000.0F;

/// Substitute for a non-finite point, which would spoil the sums even with zero weight.
const SurfacePoint kOutOfReach{Eigen::Vector3f::Constant(1e6F * kMaxDistance_m), Eigen::Vector3f::Zero()};

bool serves(const Surface* surface, bool accepts_shapeless) {
  return surface != nullptr && (surface->planar() || (accepts_shapeless && surface->shapeless()));
}

/// Centres of the voxels of a grid relative to the origin of the pass, in single precision.
class Centres {
 public:
  Centres(const SurfaceGrid& grid, const Eigen::Vector3d& origin_m)
      : leaf_m_(static_cast<float>(grid.leaf_m())), cell_(grid.index_of(origin_m)),
        centre_m_((grid.centre_of(cell_) - origin_m).cast<float>()) {}

  [[nodiscard]] Eigen::Vector3f operator[](VoxelIndex index) const {
    return centre_m_ + leaf_m_ * Eigen::Vector3f{static_cast<float>(index.x - cell_.x),
                                                 static_cast<float>(index.y - cell_.y),
                                                 static_cast<float>(index.z - cell_.z)};
  }

 private:
  float leaf_m_;
  VoxelIndex cell_; ///< of the origin
  Eigen::Vector3f centre_m_;
};

void store_match(const Surface& surface, const Eigen::Vector3f& mean_m, std::size_t i, MatchBlock& matches) {
  const bool planar = surface.planar();
  matches.x_m[i] = mean_m.x();
  matches.y_m[i] = mean_m.y();
  matches.z_m[i] = mean_m.z();
  matches.normal_x[i] = planar ? surface.normal.x() : 0.0F;
  matches.normal_y[i] = planar ? surface.normal.y() : 0.0F;
  matches.normal_z[i] = planar ? surface.normal.z() : 0.0F;
  matches.across_m2[i] = planar ? surface.variance_m2 : surface.strewn_m2;
  matches.tilt_rad2[i] = planar ? surface.tilt_rad2 : 0.0F;
  matches.found[i] = 1.0F;
  matches.unknown[i] = 0.0F;
}

void put_none(std::size_t i, MatchBlock& matches) {
  matches.x_m[i] = matches.y_m[i] = matches.z_m[i] = 0.0F;
  matches.normal_x[i] = matches.normal_y[i] = matches.normal_z[i] = 0.0F;
  matches.across_m2[i] = 1.0F;
  matches.tilt_rad2[i] = 0.0F;
  matches.found[i] = matches.unknown[i] = 0.0F;
}

/// Points of a block in the target, relative to the origin.
struct Placed {
  PerPoint x_m, y_m, z_m;
  [[nodiscard]] Eigen::Vector3f operator[](std::size_t i) const { return {x_m[i], y_m[i], z_m[i]}; }
};

[[gnu::always_inline]] inline void place_all(const Affine& T, const SourceBlock& source, Placed& points) {
  const float r00 = T.R(0, 0), r01 = T.R(0, 1), r02 = T.R(0, 2), r10 = T.R(1, 0), r11 = T.R(1, 1), r12 = T.R(1, 2),
              r20 = T.R(2, 0), r21 = T.R(2, 1), r22 = T.R(2, 2), tx = T.t.x(), ty = T.t.y(), tz = T.t.z();
  for (std::size_t i = 0; i < kGicpBlock; ++i) {
    const float x = source.x_m[i], y = source.y_m[i], z = source.z_m[i];
    points.x_m[i] = r00 * x + r01 * y + r02 * z + tx;
    points.y_m[i] = r10 * x + r11 * y + r12 * z + ty;
    points.z_m[i] = r20 * x + r21 * y + r22 * z + tz;
  }
}

using Places = std::array<std::uint32_t, kGicpBlock>;

/// Computes SurfaceGrid::index_of for all points of a block, in single precision; arbitrary for points out of reach.
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

/// Lists the points to be looked up and returns their number. The others retain their match, or have none if out of
/// reach.
std::size_t list_open(const GicpPass& pass, const Placed& points, std::size_t count, const Cells& fine,
                      MatchBlock& matches, Places& open) {
  std::size_t listed = 0;
  for (std::size_t i = 0; i < count; ++i) {
    if (pass.look_up == LookUp::follow && fine[i] == matches.fine[i])
      continue;
    if (is_near(points[i]))
      open[listed++] = static_cast<std::uint32_t>(i);
    else
      put_none(i, matches);
  }
  return listed;
}

/// Assigns the surfaces of their voxels to the listed points, if usable. Lists the remaining points and returns their
/// number.
template <class VoxelOf>
std::size_t find_in(const GicpPass& pass, const SurfaceGrid& grid, const VoxelOf& voxel_of, const Placed& points,
                    std::size_t count, Places& open, MatchBlock& matches, PerPoint& is_unknown) {
  std::array<VoxelIndex, kGicpBlock> index;
  std::array<const Surface*, kGicpBlock> surface;
  for (std::size_t k = 0; k < count; ++k)
    index[k] = voxel_of(open[k]);
  grid.find(std::span(index).first(count), std::span(surface).first(count));
  const Centres centres(grid, pass.origin_m);
  const auto reach_m = static_cast<float>(pass.max_correspondence_m);
  std::size_t left = 0;
  for (std::size_t k = 0; k < count; ++k) {
    const std::uint32_t i = open[k];
    if (serves(surface[k], pass.accepts_shapeless)) {
      const Eigen::Vector3f mean_m = centres[index[k]] + surface[k]->mean_m;
      if (!surface[k]->planar() || std::abs(surface[k]->normal.dot(points[i] - mean_m)) < reach_m) {
        store_match(*surface[k], mean_m, i, matches);
        continue;
      }
    }
    if (pass.accepts_shapeless && surface[k] != nullptr && surface[k]->unknown())
      is_unknown[i] = 1.0F;
    open[left++] = i;
  }
  return left;
}

/// Finds the plane of the voxel around each point, in the fine grid or else in the coarse one.
void find_here(const GicpPass& pass, const Placed& points, std::size_t count, MatchBlock& matches, Isa isa) {
  Cells fine;
  run_as(isa, [&] { index_all(pass.target.fine(), pass.origin_m, points, fine); });
  Places open; // points still without a correspondence
  PerPoint is_unknown{};
  count = list_open(pass, points, count, fine, matches, open);
  matches.fine = fine;
  const auto in_fine = [&](std::uint32_t i) { return fine[i]; };
  count = find_in(pass, pass.target.fine(), in_fine, points, count, open, matches, is_unknown);
  const auto in_coarse = [&](std::uint32_t i) { return SurfaceMap::coarse_of(fine[i]); };
  count = find_in(pass, pass.target.coarse(), in_coarse, points, count, open, matches, is_unknown);
  for (const std::uint32_t i : std::span(open).first(count)) {
    put_none(i, matches);
    matches.unknown[i] = is_unknown[i];
  }
}

/// Assigns the surface with the nearest mean in the 27 voxels around the point, at most a voxel away; false if none.
bool find_around(const GicpPass& pass, const SurfaceGrid& grid, const Eigen::Vector3f& point, std::size_t i,
                 MatchBlock& matches) {
  const Centres centres(grid, pass.origin_m);
  const VoxelIndex centre = grid.index_of(pass.origin_m + point.cast<double>());
  const Surface* nearest = nullptr;
  Eigen::Vector3f nearest_mean_m;
  auto nearest_m2 = static_cast<float>(grid.leaf_m() * grid.leaf_m());
  for (int step = 0; step < 27; ++step) {
    const VoxelIndex index{centre.x + step % 3 - 1, centre.y + step / 3 % 3 - 1, centre.z + step / 9 - 1};
    const Surface* surface = grid.find(index);
    if (!serves(surface, pass.accepts_shapeless))
      continue;
    const Eigen::Vector3f mean_m = centres[index] + surface->mean_m;
    const float distance_m2 = (point - mean_m).squaredNorm();
    if (distance_m2 < nearest_m2) {
      nearest_m2 = distance_m2;
      nearest = surface;
      nearest_mean_m = mean_m;
    }
  }
  if (nearest != nullptr)
    store_match(*nearest, nearest_mean_m, i, matches);
  return nearest != nullptr;
}

/// Finds the nearest surface around each point: in the coarse grid if it has one within reach, or else in the fine one.
/// From afar the nearest of the small voxels is rarely the right one.
void find_around(const GicpPass& pass, const Placed& points, std::size_t count, MatchBlock& matches) {
  for (std::size_t i = 0; i < count; ++i) {
    const bool found = is_near(points[i]) && (find_around(pass, pass.target.coarse(), points[i], i, matches) ||
                                              find_around(pass, pass.target.fine(), points[i], i, matches));
    if (!found)
      put_none(i, matches);
  }
}

} // namespace

SourceBlock::SourceBlock(std::span<const SurfacePoint> points, std::span<const float> ages_s) : count(points.size()) {
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
  scan_x_m = x_m;
  scan_y_m = y_m;
  scan_z_m = z_m;
  if (ages_s.empty())
    return;
  const float mean_s = std::accumulate(ages_s.begin(), ages_s.end(), 0.0F) / static_cast<float>(count);
  for (std::size_t i = 0; i < count; ++i)
    younger_s[i] = mean_s - ages_s[i];
  age_s = static_cast<double>(mean_s);
}

void SourceBlock::deskew(const Vector6& twist_change) {
  const Eigen::Matrix<float, 6, 1> change = twist_change.cast<float>();
  for (std::size_t i = 0; i < kGicpBlock; ++i) {
    const float x = scan_x_m[i], y = scan_y_m[i], z = scan_z_m[i];
    x_m[i] = x + younger_s[i] * (change[0] + change[4] * z - change[5] * y);
    y_m[i] = y + younger_s[i] * (change[1] + change[5] * x - change[3] * z);
    z_m[i] = z + younger_s[i] * (change[2] + change[3] * y - change[4] * x);
  }
}

void find(const GicpPass& pass, const SourceBlock& source, MatchBlock& matches, Isa isa) {
  const Affine T = pass.T_origin_source();
  Placed points;
  run_as(isa, [&] { place_all(T, source, points); });
  for (std::size_t i = source.count; i < kGicpBlock; ++i)
    put_none(i, matches);
  if (pass.look_up == LookUp::around)
    find_around(pass, points, source.count, matches);
  else
    find_here(pass, points, source.count, matches, isa);
}

} // namespace locus
