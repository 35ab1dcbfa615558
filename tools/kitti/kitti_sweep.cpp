// SPDX-License-Identifier: Apache-2.0
#include "kitti/kitti_sweep.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "drivers/velodyne/model.hpp"

namespace locus::tools {

bool KittiSweep::begin(std::span<const KittiPoint> points, Stamp start, Stamp end) {
  column_ = kColumns;
  const std::optional<std::size_t> rings = find_returns(points, returns_);
  if (!rings)
    return false;
  rings_ = *rings;
  start_ = start;
  end_ = end;
  cells_.assign(kColumns * kRings, 0);
  for (std::size_t i = 0; i < returns_.size(); ++i) {
    const auto column = std::min(static_cast<std::size_t>(returns_[i].turned * kColumns), kColumns - 1);
    std::uint32_t& cell = cells_[column * kRings + (rings_ - 1 - returns_[i].ring)]; // 0 is the lowest
    cell = static_cast<std::uint32_t>(i + 1);
  }
  column_ = 0;
  return true;
}

/// Starts a new ring where the azimuth falls back. The few points at the start of a ring that a laser's azimuth offset
/// puts before the front do not form a ring of their own.
std::optional<std::size_t> find_returns(std::span<const KittiPoint> points, std::vector<KittiReturn>& returns) {
  constexpr double kTurn = 2.0 * std::numbers::pi, kFallsBack = 0.1, kLeastOfRing = 0.1;
  constexpr std::size_t kMaxFalls = 4 * kKittiRings;
  returns.clear();
  std::size_t ring = 0, falls = 0;
  double last = 0, first_of_ring = 0;
  for (const KittiPoint& point : points) {
    const float range_m = std::hypot(point.x_m, point.y_m, point.z_m);
    if (!(std::isfinite(range_m) && range_m > 0.0F))
      continue;
    const double clockwise = std::atan2(-static_cast<double>(point.y_m), static_cast<double>(point.x_m)); // 0 in front
    const double azimuth = clockwise > 0 ? kTurn - clockwise : -clockwise;
    if (returns.empty())
      first_of_ring = azimuth;
    if (!returns.empty() && azimuth < last - kFallsBack) {
      ++falls;
      if (last - first_of_ring > kLeastOfRing)
        ++ring;
      first_of_ring = azimuth;
    }
    last = azimuth;
    returns.push_back({point, 0.5 + clockwise / kTurn, ring});
  }
  return ring < kKittiRings && falls <= kMaxFalls ? std::optional{ring + 1} : std::nullopt;
}

const LidarPacket* KittiSweep::next() {
  if (column_ >= kColumns)
    return nullptr;
  const Duration turn = end_ - start_;
  const auto at = [&](std::size_t column) {
    return turn * static_cast<Duration::rep>(column) / static_cast<Duration::rep>(kColumns);
  };
  const std::size_t end = std::min(column_ + kColumnsPerPacket, kColumns);
  packet_.stamp = start_ + at(column_);
  packet_.duration = at(end) - at(column_);
  packet_.first_azimuth_cdeg = static_cast<std::uint16_t>(
      (velodyne::kCdegPerTurn / 2U + velodyne::kCdegPerTurn * column_ / kColumns) % velodyne::kCdegPerTurn);
  packet_.count = 0;
  for (; column_ < end; ++column_) {
    for (std::size_t bank = 0; bank < kGroupsPerColumn; ++bank)
      fill(column_, bank, packet_.storage[packet_.count++]);
  }
  return &packet_;
}

void KittiSweep::fill(std::size_t column, std::size_t bank, FiringGroup& group) const {
  constexpr float kMaxIntensity = 255.0F;
  group = {};
  group.first_laser = static_cast<std::uint8_t>(bank * FiringGroup::kLasers);
  for (std::size_t k = 0; k < FiringGroup::kLasers; ++k) {
    const std::size_t ring = bank * FiringGroup::kLasers + k;
    group.ring[k] = static_cast<std::uint8_t>(ring);
    const std::uint32_t cell = cells_[column * kRings + ring];
    if (cell == 0)
      continue;
    const auto& [point, turned, unused] = returns_[cell - 1];
    group.x_m[k] = point.x_m;
    group.y_m[k] = point.y_m;
    group.z_m[k] = point.z_m;
    group.range_m[k] = std::hypot(point.x_m, point.y_m, point.z_m);
    const Stamp fired = start_ + from_seconds(turned * to_seconds(end_ - start_));
    group.offset_ns[k] = static_cast<std::int32_t>((fired - packet_.stamp).count());
    group.intensity[k] = static_cast<std::uint8_t>(
        kMaxIntensity * (point.reflectance > 0.0F ? std::min(point.reflectance, 1.0F) : 0.0F)); // 0 for NaN
  }
}

} // namespace locus::tools
