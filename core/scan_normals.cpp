// SPDX-License-Identifier: Apache-2.0
#include "core/scan_normals.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "core/principal_axes.hpp"

namespace locus {

namespace {

/// Neighbours farther than this share of the range lie on another surface, or too far away to speak for this one.
constexpr float kMaxDistancePerRange = 0.15F;
constexpr float kMinReach_m = 0.6F;

constexpr float kMaxRoughnessOfScan_m = 0.04F;      ///< across the plane, one standard deviation
constexpr float kMinMiddleToGreatestOfScan = 0.02F; ///< below this they lie on one line
constexpr float kMaxLeastToMiddle = 0.1F;
constexpr float kMinNeighbours = 5.0F; ///< itself counted

constexpr std::size_t kBatch = 64; ///< points at a time: their moments stay in the fastest cache
using Batch = std::array<float, kBatch>;

/// Sums over a point's neighbours, from the point.
struct Moments {
  Batch count, x, y, z, xx, xy, xz, yy, yz, zz;
};

/// Unit normals towards the lidar's side of planes through the points of the moments, or zero.
void normals_of(const Moments& moments, const Batch& px, const Batch& py, const Batch& pz, Batch& nx, Batch& ny,
                Batch& nz) {
  for (std::size_t i = 0; i < kBatch; ++i) {
    const float count = moments.count[i];
    const float share = 1.0F / count;
    const float x = share * moments.x[i], y = share * moments.y[i], z = share * moments.z[i];
    const PrincipalAxes<float> axes = principal_axes<float>(
        {share * moments.xx[i] - x * x, share * moments.xy[i] - x * y, share * moments.xz[i] - x * z,
         share * moments.yy[i] - y * y, share * moments.yz[i] - y * z, share * moments.zz[i] - z * z});
    const bool trusted = (count >= kMinNeighbours) & (axes.least <= kMaxRoughnessOfScan_m * kMaxRoughnessOfScan_m) &
                         (axes.middle >= kMinMiddleToGreatestOfScan * axes.greatest) &
                         (axes.least <= kMaxLeastToMiddle * axes.middle);
    const bool looks_away = axes.x * px[i] + axes.y * py[i] + axes.z * pz[i] > 0.0F;
    const float sign = trusted ? (looks_away ? -1.0F : 1.0F) : 0.0F;
    nx[i] = sign * axes.x;
    ny[i] = sign * axes.y;
    nz[i] = sign * axes.z;
  }
}

} // namespace

ScanNormals::ScanNormals(std::size_t max_points) {
  lines_.reserve(max_points);
  neighbours_.reserve(max_points + kBatch);
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
    std::size_t nearest; ///< in time, which follows the point at hand
  };
  std::array<Beside, 2> beside{};
  if (line > 0 && lines_[line - 1].id + 1 == id)
    beside[0] = {lines_[line - 1].begin, lines_[line - 1].end, lines_[line - 1].begin};
  if (line + 1 < lines_.size() && id + 1 == lines_[line + 1].id)
    beside[1] = {lines_[line + 1].begin, lines_[line + 1].end, lines_[line + 1].begin};

  for (std::size_t i = begin; i < end; ++i) {
    auto& places = neighbours_[i].place;
    places.fill(static_cast<std::uint32_t>(i));
    std::size_t found = 0;
    const auto add = [&](std::size_t j) { places[found++] = static_cast<std::uint32_t>(j); };
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
  }
}

/// For the points from `begin` on, as many as a chunk holds; those beyond the last one are padding.
void ScanNormals::fit_planes(std::vector<SweepPoint>& points, std::size_t begin) const {
  Moments moments{};
  moments.count.fill(1.0F);
  Batch px, py, pz, reach2, nx, ny, nz;
  for (std::size_t i = 0; i < kBatch; ++i) {
    px[i] = x_[begin + i];
    py[i] = y_[begin + i];
    pz[i] = z_[begin + i];
    const float reach_m =
        std::max(kMinReach_m, kMaxDistancePerRange * std::sqrt(px[i] * px[i] + py[i] * py[i] + pz[i] * pz[i]));
    reach2[i] = reach_m * reach_m;
  }
  for (std::size_t n = 0; n < Neighbours::kMost; ++n) {
    for (std::size_t i = 0; i < kBatch; ++i) {
      const std::uint32_t j = neighbours_[begin + i].place[n];
      const float x = x_[j] - px[i], y = y_[j] - py[i], z = z_[j] - pz[i];
      const bool is_near = (j != begin + i) & (x * x + y * y + z * z <= reach2[i]);
      const float counts = is_near ? 1.0F : 0.0F;
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
  normals_of(moments, px, py, pz, nx, ny, nz);
  for (std::size_t i = 0; i < std::min(kBatch, points.size() - begin); ++i)
    points[begin + i].normal_base = {nx[i], ny[i], nz[i]};
}

void ScanNormals::estimate(std::vector<SweepPoint>& points) {
  const std::size_t padded = points.size() + kBatch;
  for (std::vector<float>* figures : {&x_, &y_, &z_})
    figures->assign(padded, 0.0F);
  neighbours_.assign(padded, {});
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
