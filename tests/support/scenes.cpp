// SPDX-License-Identifier: Apache-2.0
#include "support/scenes.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "locus_sim/dice.hpp"
#include "locus_sim/scene_builder.hpp"

namespace locus::sim {
namespace {

void tank(SceneBuilder& build, double x, double y, double radius, double height) {
  build.cylinder({x, y, 0}, radius, height, 90);
  build.cylinder({x, y, height}, radius / 3, 0.6, 110); // manhole
}

void parked_car(SceneBuilder& build, double x, double y, double yaw_rad, bool van, std::uint8_t bright) {
  if (van) {
    build.turned_box({x, y, 0.25}, {5.2, 2.0, 2.1}, yaw_rad, bright);
    return;
  }
  build.turned_box({x, y, 0.2}, {4.3, 1.8, 0.7}, yaw_rad, bright);
  build.turned_box({x, y, 0.9}, {2.3, 1.6, 0.55}, yaw_rad, bright);
}

/// Builds the houses of one side; `facade_y` is the line of their fronts, `outward` the sign of y away from the street.
void houses(SceneBuilder& build, Dice& dice, double from_x, double to_x, double facade_y, double outward) {
  for (double x = from_x; x < to_x;) {
    const double width = dice.between(8, 18), depth = dice.between(8, 14), setback = dice.between(0, 2.5);
    const double front = facade_y + outward * setback, back = front + outward * depth;
    const std::uint8_t bright = dice.brightness(30, 90);
    const double height = dice.between(5, 14);
    build.box({x, std::min(front, back), 0}, {x + width, std::max(front, back), height}, bright);
    for (double bay = dice.between(1, 3); bay < width - 2; bay += dice.between(3, 6)) { // balconies and bay windows
      const double z = dice.between(0, 3), out = front - outward * dice.between(0.2, 0.8);
      build.box({x + bay, std::min(front, out), z}, {x + bay + 1.6, std::max(front, out), z + 1.5}, bright);
    }
    x += width + (dice.between(0, 1) < 0.4 ? dice.between(1.5, 6) : 0);
  }
}

/// Furnishes one pavement.
void kerbside(SceneBuilder& build, Dice& dice, double from_x, double to_x, double side) {
  for (double x = from_x; x < to_x; x += dice.between(5.5, 14))
    parked_car(build, x, side * dice.between(4.2, 4.6), dice.between(-0.06, 0.06), dice.between(0, 1) < 0.2,
               dice.brightness(40, 200));
  for (double x = from_x + dice.between(0, 20); x < to_x; x += dice.between(16, 30))
    build.cylinder({x, side * 6.0, 0}, 0.1, dice.between(5, 8), 160);
  for (double x = from_x + dice.between(0, 20); x < to_x; x += dice.between(8, 35)) {
    const double crown = dice.between(1.0, 1.8), trunk = dice.between(2.2, 3.5), y = side * dice.between(6.8, 7.4);
    build.cylinder({x, y, 0}, dice.between(0.1, 0.25), trunk, 60);
    build.sphere({x, y, trunk + 0.8 * crown}, crown, 70);
  }
}

} // namespace

Scene room() {
  SceneBuilder build;
  build.box({-5, -4, 0}, {5, 4, 4}, 60);
  build.box({3.5, -4, 0}, {5, -2.5, 2}, 80);
  build.box({-5, 2.6, 0}, {-3, 4, 1}, 40);
  build.box({-0.5, 3.4, 0}, {1.5, 4, 2.2}, 90);
  build.turned_box({-3.6, -2.9, 0}, {1.2, 0.8, 1.1}, 0.5, 70);
  build.turned_box({3.4, 2.7, 0}, {0.8, 0.8, 0.9}, 0.3, 110);
  build.cylinder({-2.6, 2.8, 0}, 0.2, 4, 130);
  build.cylinder({2.7, -3.0, 0}, 0.15, 4, 130);
  return build.scene();
}

Scene corridor(double length_m, Walls walls) {
  SceneBuilder build;
  build.box({0, -1.5, 0}, {length_m, 1.5, 3}, 60);
  if (walls == Walls::bare)
    return build.scene();
  Dice dice(1);
  for (const double side : {-1.0, 1.0}) {
    for (double x = dice.between(1, 3); x < length_m - 1; x += dice.between(2.5, 7)) {
      const bool pillar = dice.between(0, 1) < 0.5;
      const double in = side * (pillar ? dice.between(1.0, 1.2) : 1.4), wall = side * 1.5;
      const double height = pillar ? 3.0 : 2.1, width = pillar ? 0.4 : 0.12;
      for (const double at : {x, x + 1.0}) { // a pillar stands alone, a door frame has two posts
        build.box({at, std::min(in, wall), 0}, {at + width, std::max(in, wall), height}, 100);
        if (pillar)
          break;
      }
    }
  }
  return build.scene();
}

Scene tunnel(double length_m, std::uint64_t seed) {
  constexpr double kWall_m = 2.5, kRoof_m = 4.0;
  SceneBuilder build;
  Dice dice(seed);
  build.box({0, -kWall_m, 0}, {length_m, kWall_m, kRoof_m}, 40);
  const auto rocks_per_face = static_cast<int>(length_m * 5);
  for (int rock = 0; rock < rocks_per_face; ++rock) { // boulders sunk into the faces, so that only their caps show
    const double bulge = 0.05 + 0.35 * std::pow(dice.between(0, 1), 3);
    const double radius = bulge + dice.between(0.2, 1.0);
    const double x = dice.between(0, length_m), sunk = radius - bulge;
    build.sphere({x, kWall_m + sunk, dice.between(0, kRoof_m)}, radius, dice.brightness(30, 60));
    build.sphere({dice.between(0, length_m), -kWall_m - sunk, dice.between(0, kRoof_m)}, radius,
                 dice.brightness(30, 60));
    build.sphere({dice.between(0, length_m), dice.between(-kWall_m, kWall_m), kRoof_m + sunk}, radius, 45);
  }
  return build.scene();
}

Scene street(double length_m, std::uint64_t seed) {
  constexpr double kTile_m = 50, kHalfWidth_m = 60;
  SceneBuilder build;
  Dice dice(seed);
  const double from_x = -50, to_x = length_m + 50;
  for (double x = from_x; x < to_x;
       x += kTile_m) // in tiles: one long strip would make every box of the tree a long one
    build.rectangle({x, -kHalfWidth_m, 0}, {kTile_m, 0, 0}, {0, 2 * kHalfWidth_m, 0}, 20);
  for (const double side : {-1.0, 1.0}) {
    houses(build, dice, from_x, to_x, side * 9, side);
    kerbside(build, dice, from_x, to_x, side);
  }
  return build.scene();
}

Scene plant() {
  SceneBuilder build;
  Dice dice(7);
  build.box({0, 0, 0}, {64, 20, 7}, 60);
  for (const auto& [from_y, to_y] : {std::pair{0.0, 3.0}, {6.0, 14.0}, {17.0, 20.0}}) // solid, between the corridors
    build.box({24, from_y, 0}, {40, to_y, 7}, 60);
  for (const double y : {3.0, 14.0}) {
    build.box({24, y, 3}, {40, y + 3, 7}, 50); // ceiling of a corridor
    for (double x = 25 + dice.between(0, 1); x < 39; x += dice.between(2.2, 4.5)) {
      const double wall = dice.between(0, 1) < 0.5 ? y : y + 2.8;
      build.box({x, wall, 0}, {x + dice.between(0.2, 0.5), wall + 0.2, 2.4}, 100);
    }
  }
  for (const double hall_x : {0.0, 40.0})
    for (const double x : {6.0, 12.0, 18.0})
      for (const double y : {2.2, 17.8})
        build.box({hall_x + x - 0.25, y - 0.25, 0}, {hall_x + x + 0.25, y + 0.25, 7}, 80);
  build.box({8, 7.5, 0}, {13, 12.5, 2.6}, 110); // turbine and its generator
  build.turned_box({15.5, 10, 0}, {3, 2.2, 1.9}, 0.2, 130);
  tank(build, 2.0, 18.2, 1.2, 4.0);
  tank(build, 2.2, 1.8, 0.9, 3.0);
  tank(build, 50, 10, 1.8, 5.0);
  tank(build, 55, 10.5, 1.2, 3.5);
  build.box({46, 8.5, 0}, {47.5, 11.5, 1.6}, 90);
  build.turned_box({62.4, 5, 0}, {1.2, 2.5, 2.1}, 0.1, 150); // switchgear
  build.turned_box({62.3, 14, 0}, {1.0, 3.0, 2.1}, -0.15, 150);
  build.turned_box({1.0, 8, 0}, {0.9, 2.0, 2.0}, 0.05, 150);
  for (const double y : {6.6, 13.4}) { // vertical pipes
    build.cylinder({20.5, y, 0}, 0.15, 7, 170);
    build.cylinder({43.0, y, 0}, 0.2, 7, 170);
  }
  return build.scene();
}

Course plant_course(Duration at_least, double speed_mps) {
  const std::vector<Eigen::Vector2d> lap{{22, 15.5}, {43, 15.5}, {52.5, 14.5}, {59, 14}, {59, 6},   {52, 5.5},
                                         {43, 4.5},  {22, 4.5},  {15, 5.2},    {4.5, 5}, {4.5, 15}, {15, 14.8}};
  const double lap_m = 120; // lower bound: corners are cut
  const auto laps = 1 + static_cast<int>(to_seconds(at_least) * speed_mps / lap_m);
  std::vector<Eigen::Vector2d> waypoints{{15, 14.8}};
  for (int i = 0; i < laps; ++i)
    waypoints.insert(waypoints.end(), lap.begin(), lap.end());
  return Course::along(waypoints, {.speed_mps = speed_mps, .turn_rate_radps = 0.8 * std::max(1.0, speed_mps)});
}

Course room_course(Duration at_least, double speed_mps) {
  const double lap_m = 8; // lower bound: corners are cut
  const auto laps = 1 + static_cast<int>(to_seconds(at_least) * speed_mps / lap_m);
  std::vector<Eigen::Vector2d> waypoints{{-1.2, -1.2}};
  for (int i = 0; i < laps; ++i)
    waypoints.insert(waypoints.end(), {{1.2, -1.2}, {1.2, 1.2}, {-1.2, 1.2}, {-1.2, -1.2}});
  return Course::along(waypoints, {.speed_mps = speed_mps, .turn_rate_radps = 2.0});
}

Start room_start() { return {.position_m = {-1.2, -1.2}, .heading_rad = 0}; }

Course weaving_course(Duration at_least, double speed_mps, double aside_m, double wave_m) {
  const double length_m = to_seconds(at_least) * speed_mps;
  std::vector<Eigen::Vector2d> waypoints{{0, 0}};
  for (double side = 1; waypoints.back().x() < length_m || waypoints.size() < 3; side = -side)
    waypoints.emplace_back(waypoints.back().x() + wave_m / 2, side * aside_m);
  return Course::along(waypoints, {.speed_mps = speed_mps});
}

Start weaving_start(double x_m, double aside_m, double wave_m) {
  return {.position_m = {x_m, 0}, .heading_rad = std::atan2(aside_m, wave_m / 2)};
}

Start plant_start() { return {.position_m = {15, 14.8}, .heading_rad = std::atan2(15.5 - 14.8, 22.0 - 15.0)}; }

} // namespace locus::sim
