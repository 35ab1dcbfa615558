// SPDX-License-Identifier: Apache-2.0
#include "core/ingest/point_filters.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace locus {

namespace {

/// Returns a key with 21 bits per axis around the base; a sweep reaches no farther than that many voxels.
std::uint64_t voxel_key(const Eigen::Vector3f& position_m, double leaf_m) {
  std::uint64_t key = 0;
  for (int axis = 0; axis < 3; ++axis) {
    const auto cell = static_cast<std::int64_t>(std::floor(static_cast<double>(position_m[axis]) / leaf_m));
    key = key << 21U | (static_cast<std::uint64_t>(cell) & 0x1FFFFFU);
  }
  return key;
}

} // namespace

VoxelFilter::VoxelFilter(const VoxelFilterOptions& options, std::size_t max_points) : leaf_m_(options.leaf_m) {
  keyed_.reserve(max_points);
  means_.reserve(max_points);
}

void VoxelFilter::apply(std::vector<SweepPoint>& points) {
  keyed_.clear();
  for (std::size_t i = 0; i < points.size(); ++i)
    keyed_.push_back({voxel_key(points[i].position_base_m, leaf_m_), static_cast<std::uint32_t>(i)});
  std::sort(keyed_.begin(), keyed_.end(),
            [](const Keyed& a, const Keyed& b) { return a.voxel != b.voxel ? a.voxel < b.voxel : a.point < b.point; });

  means_.clear();
  for (std::size_t begin = 0; begin < keyed_.size();) {
    SweepPoint mean = points[keyed_[begin].point];
    std::size_t end = begin + 1;
    for (; end < keyed_.size() && keyed_[end].voxel == keyed_[begin].voxel; ++end) {
      const SweepPoint& point = points[keyed_[end].point];
      mean.position_base_m += point.position_base_m;
      mean.normal_base += point.normal_base;
      mean.age_s += point.age_s;
      mean.intensity += point.intensity;
    }
    const float share = 1.0F / static_cast<float>(end - begin);
    mean.position_base_m *= share;
    mean.age_s *= share;
    mean.intensity *= share;
    mean.normal_base.normalize(); // a zero vector stays zero
    keyed_[means_.size()] = keyed_[begin];
    means_.push_back(mean);
    begin = end;
  }

  keyed_.resize(means_.size());
  for (std::size_t i = 0; i < means_.size(); ++i)
    keyed_[i].voxel = i;
  std::sort(keyed_.begin(), keyed_.end(), [](const Keyed& a, const Keyed& b) { return a.point < b.point; });
  points.clear();
  for (const Keyed& keyed : keyed_)
    points.push_back(means_[keyed.voxel]);
}

void RandomFilter::apply(std::vector<SweepPoint>& points) {
  constexpr double kUnit = 1.0 / 9007199254740992.0; // 2^-53
  const auto wanted = static_cast<std::size_t>(std::llround(keep_ * static_cast<double>(points.size())));
  std::size_t kept = 0;
  for (std::size_t i = 0; i < points.size() && kept < wanted; ++i) {
    const double uniform = static_cast<double>(random_() >> 11U) * kUnit;
    if (uniform * static_cast<double>(points.size() - i) < static_cast<double>(wanted - kept))
      points[kept++] = points[i];
  }
  points.resize(kept);
}

} // namespace locus
