// SPDX-License-Identifier: Apache-2.0
#include "core/ingest/scan_normals.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "core/base/principal_axes.hpp"

namespace locus {

namespace {

/// Largest distance of a neighbour, as a share of the range; a farther one lies on another surface or is not
/// representative.
constexpr float kMaxDistancePerRange = 0.15F;
constexpr float kMinReach_m = 0.6F;

constexpr float kMaxRoughnessOfScan_m = 0.04F;      ///< across the plane, one standard deviation
constexpr float kMinMiddleToGreatestOfScan = 0.02F; ///< below this the points lie on one line
constexpr float kMaxLeastToMiddle = 0.1F;
constexpr float kMinNeighbours = 5.0F; ///< including the point itself

constexpr std::size_t kBatch = 64; ///< points per batch: their moments stay in the fastest cache
using Batch = std::array<float, kBatch>;

/// Sums over a point's neighbours, relative to the point.
struct Moments {
  Batch count, x, y, z, xx, xy, xz, yy, yz, zz;
};

/// Points of a batch, and the squared distance up to which their neighbours are used.
struct BatchPoints {
  Batch x, y, z, reach2;
};

[[gnu::always_inline]] inline BatchPoints points_of(const float* x, const float* y, const float* z) {
  BatchPoints p;
  for (std::size_t i = 0; i < kBatch; ++i) {
    p.x[i] = x[i];
    p.y[i] = y[i];
    p.z[i] = z[i];
    const float reach2 = kMaxDistancePerRange * kMaxDistancePerRange * (x[i] * x[i] + y[i] * y[i] + z[i] * z[i]);
    p.reach2[i] = std::max(kMinReach_m * kMinReach_m, reach2);
  }
  return p;
}

/// Adds one neighbour of each point; one that coincides with the point is ignored.
[[gnu::always_inline]] inline void add_neighbour(const BatchPoints& p, const float* x_m, const float* y_m,
                                                 const float* z_m, const std::int32_t* neighbour, Moments& moments) {
  for (std::size_t i = 0; i < kBatch; ++i) {
    const auto j = static_cast<std::ptrdiff_t>(neighbour[i]);
    const float x = x_m[j] - p.x[i], y = y_m[j] - p.y[i], z = z_m[j] - p.z[i];
    const float distance2 = x * x + y * y + z * z;
    const std::int32_t contributes = -(distance2 <= p.reach2[i]) & -(distance2 > 0.0F);
    const auto counts = static_cast<float>(-contributes);
    const float cx = counts * x, cy = counts * y, cz = counts * z;
    moments.count[i] += counts;
    moments.x[i] += cx;
    moments.y[i] += cy;
    moments.z[i] += cz;
    moments.xx[i] += cx * x;
    moments.xy[i] += cx * y;
    moments.xz[i] += cx * z;
    moments.yy[i] += cy * y;
    moments.yz[i] += cy * z;
    moments.zz[i] += cz * z;
  }
}

/// Computes unit normals, facing the lidar, of planes through the points of the moments; zero if unreliable.
[[gnu::always_inline]] inline void normals_of(const Moments& moments, const BatchPoints& p, Batch& nx, Batch& ny,
                                              Batch& nz) {
  for (std::size_t i = 0; i < kBatch; ++i) {
    const float count = moments.count[i];
    const float share = 1.0F / count;
    const float x = share * moments.x[i], y = share * moments.y[i], z = share * moments.z[i];
    const PrincipalAxes<float> axes = principal_axes<float>(
        {share * moments.xx[i] - x * x, share * moments.xy[i] - x * y, share * moments.xz[i] - x * z,
         share * moments.yy[i] - y * y, share * moments.yz[i] - y * z, share * moments.zz[i] - z * z});
    const std::int32_t trusted =
        -(count >= kMinNeighbours) & -(axes.least <= kMaxRoughnessOfScan_m * kMaxRoughnessOfScan_m) &
        -(axes.middle >= kMinMiddleToGreatestOfScan * axes.greatest) &
        -(axes.least <= kMaxLeastToMiddle * axes.middle); // masks: conditions would be branches
    const float towards = axes.x * p.x[i] + axes.y * p.y[i] + axes.z * p.z[i];
    const float sign = static_cast<float>(-trusted) * -std::copysign(1.0F, towards);
    nx[i] = sign * axes.x;
    ny[i] = sign * axes.y;
    nz[i] = sign * axes.z;
  }
}

} // namespace

ScanNormals::ScanNormals(std::size_t max_points, Isa isa) : isa_(isa) {
  lines_.reserve(max_points);
  for (std::vector<std::int32_t>& places : neighbours_)
    places.reserve(max_points + kBatch);
  for (std::vector<float>* figures : {&x_, &y_, &z_})
    figures->reserve(max_points + kBatch);
}

void ScanNormals::find_lines(const std::vector<SweepPoint>& points) {
  lines_.clear();
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (lines_.empty() || lines_.back().id != points[i].scan_line)
      lines_.push_back({points[i].scan_line, i, i});
    lines_.back().end = i + 1;
  }
}

void ScanNormals::find_neighbours(const std::vector<SweepPoint>& points, std::size_t line) {
  const auto [id, begin, end] = lines_[line];
  struct Beside {
    std::size_t begin, end;
    std::size_t nearest; ///< in time to the current point; advances with it
  };
  std::array<Beside, 2> beside{};
  if (line > 0 && lines_[line - 1].id + 1 == id)
    beside[0] = {lines_[line - 1].begin, lines_[line - 1].end, lines_[line - 1].begin};
  if (line + 1 < lines_.size() && id + 1 == lines_[line + 1].id)
    beside[1] = {lines_[line + 1].begin, lines_[line + 1].end, lines_[line + 1].begin};

  for (std::size_t i = begin; i < end; ++i) {
    std::size_t found = 0;
    const auto add = [&](std::size_t j) { neighbours_[found++][i] = static_cast<std::int32_t>(j); };
    if (i > begin)
      add(i - 1);
    if (i + 1 < end)
      add(i + 1);
    for (auto& [first, last, nearest] : beside) {
      if (first == last)
        continue;
      const auto time_apart = [&](std::size_t j) { return std::abs(points[j].age_s - points[i].age_s); };
      while (nearest + 1 < last && time_apart(nearest + 1) <= time_apart(nearest))
        ++nearest;
      for (std::size_t j = std::max(nearest, first + 1) - 1; j < std::min(nearest + 2, last); ++j)
        add(j);
    }
    while (found < kMostNeighbours)
      add(i);
  }
}

/// Fits planes to one batch of points from `begin` on; entries beyond the last point are padding.
void ScanNormals::fit_planes(std::vector<SweepPoint>& points, std::size_t begin) const {
  Batch nx, ny, nz;
  run_as(isa_, [&] {
    Moments moments{};
    moments.count.fill(1.0F);
    const BatchPoints batch = points_of(&x_[begin], &y_[begin], &z_[begin]);
    for (const std::vector<std::int32_t>& neighbour : neighbours_)
      add_neighbour(batch, x_.data(), y_.data(), z_.data(), &neighbour[begin], moments);
    normals_of(moments, batch, nx, ny, nz);
  });
  for (std::size_t i = 0; i < std::min(kBatch, points.size() - begin); ++i)
    points[begin + i].normal_base = {nx[i], ny[i], nz[i]};
}

void ScanNormals::estimate(std::vector<SweepPoint>& points) {
  const std::size_t padded = points.size() + kBatch;
  for (std::vector<float>* figures : {&x_, &y_, &z_})
    figures->assign(padded, 0.0F);
  for (std::vector<std::int32_t>& places : neighbours_)
    places.assign(padded, 0);
  for (std::size_t i = 0; i < points.size(); ++i) {
    x_[i] = points[i].position_base_m.x();
    y_[i] = points[i].position_base_m.y();
    z_[i] = points[i].position_base_m.z();
  }
  find_lines(points);
  for (std::size_t line = 0; line < lines_.size(); ++line)
    find_neighbours(points, line);
  for (std::size_t begin = 0; begin < points.size(); begin += kBatch)
    fit_planes(points, begin);
}

} // namespace locus
