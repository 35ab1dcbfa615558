// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <numbers>

#include "locus_sim/dice.hpp"
#include "locus_sim/noise.hpp"
#include "locus_sim/scene_builder.hpp"
#include "locus_sim/world.hpp"

namespace locus::sim {
namespace {

constexpr double kHalfSite_m = 120;
constexpr double kFree_m = 2; // between the middle of a track and a trunk

Roads roads() {
  Roads roads;
  roads.add({{-70, -60},
             {-20, -75},
             {30, -62},
             {75, -70},
             {82, -20},
             {70, 30},
             {78, 74},
             {25, 66},
             {-25, 78},
             {-75, 62},
             {-82, 10},
             {-70, -60}});
  roads.add({{-20, -75}, {-10, -30}, {-28, 12}, {-25, 78}});
  roads.add({{-82, 10}, {-28, 12}, {20, 8}, {70, 30}});
  roads.add({{20, 8}, {30, -62}});
  return roads;
}

Jet ground_m(const Jet& x, const Jet& y) {
  constexpr double kTurn = 2 * std::numbers::pi;
  return 1.8 * sin(kTurn / 120 * x + 0.4) + 1.3 * sin(kTurn / 85 * y + kTurn / 300 * x) +
         0.35 * sin(kTurn / 31 * x - kTurn / 43 * y) + 0.08 * sin(kTurn / 9 * x + kTurn / 13 * y);
}

Eigen::Vector3d on_ground(double x, double y) { return {x, y, ground_m(x, y).value}; }

/// Builds the turf from triangles; the tracks are as rough.
void meadow(SceneBuilder& build) {
  constexpr double kCell_m = 0.8;
  const Noise turf(1);
  const auto at = [&](double x, double y) -> Eigen::Vector3d {
    return on_ground(x, y) + Eigen::Vector3d{0, 0, 0.04 * turf(1.7 * Eigen::Vector3d{x, y, 0})};
  };
  for (double x = -kHalfSite_m; x < kHalfSite_m; x += kCell_m) {
    for (double y = -kHalfSite_m; y < kHalfSite_m; y += kCell_m) {
      const Eigen::Vector3d a = at(x, y), b = at(x + kCell_m, y), c = at(x + kCell_m, y + kCell_m),
                            d = at(x, y + kCell_m);
      build.triangle(a, b, c, 22);
      build.triangle(a, c, d, 22);
    }
  }
}

/// Builds a trunk, a few boughs and tufts of leaves around them.
void tree(SceneBuilder& build, Dice& dice, const Eigen::Vector3d& foot) {
  const double height = dice.between(4, 11), radius = 0.02 * height + dice.between(0, 0.1);
  build.pipe(foot, foot + Eigen::Vector3d{dice.between(-0.3, 0.3), dice.between(-0.3, 0.3), 0.8 * height}, radius, 35);
  for (int i = 0; i < 14; ++i) {
    const double angle = dice.between(0, 2 * std::numbers::pi), up = dice.between(0.35, 1) * height;
    const double out = dice.between(0.05, 0.3) * height;
    const Eigen::Vector3d tuft = foot + Eigen::Vector3d{out * std::cos(angle), out * std::sin(angle), up};
    build.sphere(tuft, dice.between(0.04, 0.11) * height, 40);
    if (i % 3 == 0)
      build.pipe(foot + Eigen::Vector3d{0, 0, 0.7 * up}, tuft, 0.25 * radius, 35);
  }
}

void fence(SceneBuilder& build, Dice& dice, const Eigen::Vector2d& from, const Eigen::Vector2d& to) {
  const Eigen::Vector2d along = (to - from).normalized();
  Eigen::Vector3d last = on_ground(from.x(), from.y());
  for (double at = 0; at < (to - from).norm(); at += dice.between(2.6, 3.4)) {
    const Eigen::Vector2d place = from + at * along;
    const Eigen::Vector3d post = on_ground(place.x(), place.y());
    build.cylinder(post, 0.06, 1.25, 45);
    for (const double height : {0.6, 1.1})
      if (at > 0)
        build.pipe(last + Eigen::Vector3d{0, 0, height}, post + Eigen::Vector3d{0, 0, height}, 0.03, 45);
    last = post;
  }
}

} // namespace

World make_field(std::uint64_t seed) {
  Dice dice(seed);
  Roads tracks = roads();
  SceneBuilder build;
  meadow(build);
  const auto somewhere = [&] {
    while (true) {
      const double x = dice.between(-110, 110), y = dice.between(-110, 110);
      if (tracks.distance_m({x, y}) > kFree_m)
        return on_ground(x, y);
    }
  };
  for (int i = 0; i < 90; ++i)
    tree(build, dice, somewhere());
  for (int i = 0; i < 60; ++i) // bushes
    build.sphere(somewhere(), dice.between(0.3, 1.2), dice.brightness(30, 50));
  for (int i = 0; i < 50; ++i) { // rocks
    const double size = dice.between(0.3, 1.4);
    build.turned_box(somewhere() - Eigen::Vector3d{0, 0, 0.2}, {size, 0.8 * size, 0.7 * size}, dice.between(0, 3), 40);
  }
  fence(build, dice, {-100, -95}, {100, -98});
  fence(build, dice, {40, -45}, {48, 20});
  fence(build, dice, {-60, 30}, {-40, 55});
  const Eigen::Vector3d barn = on_ground(-45, -30) - Eigen::Vector3d{0, 0, 1};
  build.turned_box(barn, {14, 9, 6}, 0.4, 70);
  build.turned_box(on_ground(52, 50) - Eigen::Vector3d{0, 0, 1}, {5, 4, 4}, -0.2, 55);
  return {.scene = build.scene(),
          .roads = std::move(tracks),
          .ground_m = ground_m,
          .terrain = {.height_m = 0.02, .tilt_rad = 0.025, .wavelength_m = 2.3},
          .max_speed_mps = 1.5};
}

} // namespace locus::sim
