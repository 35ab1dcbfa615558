// SPDX-License-Identifier: Apache-2.0
#include "accuracy/nearest_distances.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "accuracy/voxel_key.hpp"

namespace locus {

/// Uses cells two reaches wide, so the ball around a point touches eight of them.
NearestDistances::NearestDistances(std::span<const Eigen::Vector3f> points, float reach_m)
    : points_(points), reach_m_(reach_m), squared_m2_(points.size(), reach_m * reach_m) {
  std::vector<std::pair<Cell, std::uint32_t>> entries;
  entries.reserve(8 * points.size());
  for (std::uint32_t i = 0; i < points.size(); ++i) {
    for (int corner = 0; corner < 8; ++corner) {
      const Eigen::Vector3f direction((corner & 1) == 0 ? -1 : 1, (corner & 2) == 0 ? -1 : 1,
                                      (corner & 4) == 0 ? -1 : 1);
      entries.emplace_back(cell_of(points[i] + reach_m * direction), i);
    }
  }
  std::ranges::sort(entries);
  members_.reserve(entries.size());
  for (const auto& [cell, point] : entries)
    members_.push_back(point);
  for (std::size_t begin = 0, end = 0; begin < entries.size(); begin = end) {
    while (end < entries.size() && entries[end].first == entries[begin].first)
      ++end;
    cells_.emplace(entries[begin].first, Members{members_}.subspan(begin, end - begin));
  }
}

NearestDistances::Cell NearestDistances::cell_of(const Eigen::Vector3f& position) const {
  return voxel_key(position, 2 * reach_m_);
}

void NearestDistances::offer(const Eigen::Vector3f& candidate) {
  const Cell cell = cell_of(candidate);
  if (cell != latest_.first) {
    const auto found = cells_.find(cell);
    latest_ = {cell, found == cells_.end() ? Members{} : found->second};
  }
  for (const std::uint32_t i : latest_.second)
    squared_m2_[i] = std::min(squared_m2_[i], (points_[i] - candidate).squaredNorm());
}

std::vector<float> NearestDistances::distances_m() const {
  std::vector<float> distances;
  for (const float squared_m2 : squared_m2_)
    distances.push_back(squared_m2 < reach_m_ * reach_m_ ? std::sqrt(squared_m2)
                                                         : std::numeric_limits<float>::infinity());
  return distances;
}

} // namespace locus
