// SPDX-License-Identifier: Apache-2.0
#include "locus_sim/own_parts.hpp"

#include <cmath>

#include "core/base/pose.hpp"

namespace locus::sim {
namespace {

constexpr double kRoom_m =
    0.1; // margin of the box around the parts, larger than the position error of a lidar that is mounted inaccurately

Surface tube(const Eigen::Vector3d& from, const Eigen::Vector3d& to, double radius_m, std::uint8_t brightness) {
  return {Cylinder{from, radius_m, (to - from).norm(), (to - from).normalized()}, brightness};
}

/// Returns a part at `place`, at the height of the lidar.
Surface part(int index, const Eigen::Vector3d& place, Dice& dice) {
  const Eigen::Vector3d up{0, 0, 1};
  switch (index % 4) {
  case 0: // antenna mast
    return tube(place - 0.4 * up, place + 0.4 * up, dice.between(0.02, 0.04), dice.brightness(10, 60));
  case 1: // cable
    return tube(place - 0.3 * up, place + Eigen::Vector3d{dice.between(-0.1, 0.1), 0, 0.15}, dice.between(0.005, 0.01),
                dice.brightness(5, 15));
  case 2: // arm
    return tube(place - 0.3 * up, place + Eigen::Vector3d{dice.between(-0.1, 0.1), 0, 0.1}, dice.between(0.04, 0.06),
                dice.brightness(30, 60));
  default: // payload rail
    return {Box{place, {dice.between(0.08, 0.15), 0.02, dice.between(0.03, 0.06)}}, dice.brightness(40, 80)};
  }
}

Bounds with_room(const Bounds& bounds) { return {bounds.min_m.array() - kRoom_m, bounds.max_m.array() + kRoom_m}; }

} // namespace

OwnParts own_parts(int count, const Eigen::Vector3d& lidar_m, Dice& dice) {
  OwnParts all;
  for (int i = 0; i < count; ++i) {
    const bool inside = i % 2 == 0;
    const double aside_rad = (dice.chance(0.5) ? 1 : -1) * kRadPerDeg * dice.between(25, 50);
    const double ahead = inside ? -1 : 1, away_m = dice.between(0.55, 0.75);
    const Eigen::Vector3d place =
        lidar_m + away_m * Eigen::Vector3d{ahead * std::cos(aside_rad), std::sin(aside_rad), 0};
    all.surfaces.push_back(part(i, place, dice));
    if (!inside)
      continue;
    const Bounds bounds =
        with_room(std::visit([](const auto& shape) { return shape.bounds(); }, all.surfaces.back().shape));
    all.body_box = all.body_box ? united(*all.body_box, bounds) : bounds;
  }
  return all;
}

} // namespace locus::sim
