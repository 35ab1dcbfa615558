// SPDX-License-Identifier: Apache-2.0
#include "locus_sim/figures.hpp"

#include <cmath>

namespace locus::sim {
namespace {

/// Pair of limbs that hang from joints on both sides and swing in opposite phase.
struct Limbs {
  Surface left, right;
};
Limbs limbs(double aside_m, double up_m, double radius_m, double length_m, double swing_rad, std::uint8_t bright) {
  const double s = std::sin(swing_rad), c = std::cos(swing_rad);
  return {{Cylinder{{0, aside_m, up_m}, radius_m, length_m, {s, 0, -c}}, bright},
          {Cylinder{{0, -aside_m, up_m}, radius_m, length_m, {-s, 0, -c}}, bright}};
}

/// Returns a box, given by the centre of its floor and its size.
Surface box(const Eigen::Vector3d& floor_m, const Eigen::Vector3d& size_m, std::uint8_t bright) {
  return {Box{floor_m + Eigen::Vector3d{0, 0, size_m.z() / 2}, size_m / 2}, bright};
}

void add_wheels(std::vector<Surface>& parts, double ahead_m, double aside_m, double radius_m) {
  constexpr double kWidth_m = 0.2;
  for (const double x : {-ahead_m, ahead_m})
    for (const double y : {-aside_m, aside_m - kWidth_m})
      parts.push_back({Cylinder{{x, y, radius_m}, radius_m, kWidth_m, Eigen::Vector3d::UnitY()}, 8});
}

} // namespace

std::vector<Surface> standing_person() {
  return {{Cylinder{{0.08, 0.1, 0}, 0.07, 0.85}, 25},
          {Cylinder{{-0.08, -0.1, 0}, 0.07, 0.85}, 25},
          {Cylinder{{0, 0, 0.8}, 0.19, 0.65}, 60},
          {Sphere{{0, 0, 1.62}, 0.12}, 45}};
}

std::vector<Surface> walking_person(double swing_rad) {
  const Limbs legs = limbs(0.1, 0.87, 0.07, 0.85, swing_rad, 25);
  const Limbs arms = limbs(0.24, 1.42, 0.045, 0.62, -0.8 * swing_rad, 60);
  return {{Cylinder{{0, 0, 0.8}, 0.19, 0.65}, 60},
          {Sphere{{0, 0, 1.62}, 0.12}, 45},
          legs.left,
          legs.right,
          arms.left,
          arms.right};
}

std::vector<Surface> forklift(double yaw_rad) {
  const double c = std::cos(yaw_rad), s = std::sin(yaw_rad);
  const auto box = [&](double ahead, double z, double length, double width, double height, std::uint8_t bright) {
    return Surface{Box{{c * ahead, s * ahead, z + height / 2}, {length / 2, width / 2, height / 2}, c, s}, bright};
  };
  return {box(-0.2, 0.1, 2.0, 1.1, 1.0, 70),
          box(0.85, 0.05, 0.15, 0.9, 2.1, 40),
          box(1.4, 0.1, 1.0, 0.7, 0.08, 50),
          box(-0.3, 1.1, 1.1, 0.9, 0.08, 50),
          {Cylinder{{-0.2 * c, -0.2 * s, 1.1}, 0.22, 0.7}, 60}};
}

std::vector<Surface> car() {
  std::vector<Surface> parts{box({0, 0, 0.25}, {4.3, 1.75, 0.65}, 55), box({-0.3, 0, 0.9}, {2.3, 1.5, 0.55}, 20)};
  add_wheels(parts, 1.3, 0.85, 0.31);
  return parts;
}

std::vector<Surface> van() {
  std::vector<Surface> parts{box({-0.4, 0, 0.3}, {4.2, 1.9, 1.9}, 80), box({2.1, 0, 0.3}, {0.8, 1.9, 0.9}, 60)};
  add_wheels(parts, 1.5, 0.92, 0.34);
  return parts;
}

} // namespace locus::sim
