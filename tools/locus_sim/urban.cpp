// SPDX-License-Identifier: Apache-2.0
#include <algorithm>

#include "locus_sim/furnishing.hpp"
#include "locus_sim/world.hpp"

namespace locus::sim {
namespace {

// Plan view of the site: turbine hall in the north, boiler hall in the south-west, stores in the south-east, corridors
// between them.
constexpr double kSite_m = 100, kTurbineHallRoof_m = 20, kBoilerHallRoof_m = 15, kStoresRoof_m = 8, kCeiling_m = 3.2;
constexpr double kTurbineHallY = 62, kNorthCorridorY = 60, kBlocksTopY = 57, kBlocksBottomY = 43, kSouthCorridorY = 40,
                 kSouthHallsY = 38, kStoresX = 60, kBoilerHallX = 58;

// Ramps: a hump in the turbine hall, and the platform of the boiler hall.
constexpr double kHump_m = 1.6, kPlatform_m = 3.0;

Roads roads() {
  Roads roads;
  roads.add({{9.5, 58.5}, {20, 58.5}, {52, 58.5}, {58, 58.5}, {80, 58.5}, {90.5, 58.5}}); // north corridor
  roads.add({{9.5, 41.5}, {36, 41.5}, {46, 41.5}, {52, 41.5}, {85, 41.5}, {90.5, 41.5}}); // south corridor
  for (const double x : {9.5, 52.0, 90.5})
    roads.add({{x, 58.5}, {x, 41.5}});
  roads.add({{6, 67}, {20, 67}, {35, 67}, {58, 67}, {65, 67}, {80, 67}, {94, 67}}); // turbine hall
  roads.add({{6, 94.5}, {35, 94.5}, {67, 94.5}, {94, 94.5}});
  roads.add({{6, 67}, {6, 94.5}});
  roads.add({{35, 67}, {35, 94.5}});
  roads.add({{65, 67}, {67, 94.5}});
  roads.add({{94, 67}, {94, 94.5}});
  for (const double x : {20.0, 58.0, 80.0})
    roads.add({{x, 58.5}, {x, 67}});
  roads.add({{36, 41.5}, {36, 31}, {12, 31}, {4.5, 31}, {4.5, 4}, {20, 4}, {36, 4}, {54, 4}}); // boiler hall
  roads.add({{46, 41.5}, {46, 31}, {36, 31}, {36, 18}, {36, 4}});
  roads.add({{36, 18}, {20, 18}, {20, 4}});
  roads.add({{46, 31}, {54, 31}, {54, 20}, {54, 4}});
  roads.add({{54, 20}, {66, 20}, {66, 6}, {94, 6}, {94, 32}, {85, 32}, {66, 32}, {66, 20}}); // stores
  roads.add({{85, 41.5}, {85, 32}});
  return roads;
}

/// Returns the height of the ramps, their kinks rounded, by their position in the hall.
Jet ground_m(const Jet& x, const Jet& y) {
  constexpr double kRounding_m = 1.5;
  const auto beyond = [](const Jet& at, double from) { return ease(at - from); }; // over a metre from there
  const Jet hump = (ramp(x - 38, 11, kRounding_m) - ramp(x - 53, 11, kRounding_m)) * beyond(y, 91);
  const Jet on_west_ramp = 1.0 - beyond(x, 8), on_south_ramp = beyond(y, 26.5) - beyond(y, 35.5);
  const Jet platform = ramp(y - 6, 18, kRounding_m) * (1.0 - ramp(x - 13, 17, kRounding_m)) *
                       (1.0 - (1.0 - on_west_ramp) * (1.0 - on_south_ramp)) * (1.0 - beyond(y, 36));
  return kHump_m * hump + kPlatform_m * platform;
}

double height_m(double x, double y) { return ground_m(x, y).value; }

/// Builds the surface of a ramp: strips across its direction of rise, and its flanks.
void ramp(SceneBuilder& build, const Area& area, bool along_x) {
  constexpr double kStrip_m = 0.5;
  const Eigen::Index axis = along_x ? 0 : 1;
  const Eigen::Vector2d middle = (area.min_m + area.max_m) / 2;
  const auto corner = [&](double along, double across) {
    const double x = along_x ? along : across, y = along_x ? across : along;
    return Eigen::Vector3d{x, y, along_x ? height_m(x, middle.y()) : height_m(middle.x(), y)};
  };
  for (double at = area.min_m[axis]; at < area.max_m[axis]; at += kStrip_m) {
    const double to = std::min(at + kStrip_m, area.max_m[axis]);
    const Eigen::Vector3d a = corner(at, area.min_m[1 - axis]), b = corner(to, area.min_m[1 - axis]),
                          c = corner(at, area.max_m[1 - axis]);
    build.rectangle(a, b - a, c - a, 45);
    for (const Eigen::Vector3d& foot : {a, c}) {
      const Eigen::Vector3d level{b.x() - a.x(), b.y() - a.y(), 0};
      build.rectangle({foot.x(), foot.y(), 0}, level, {0, 0, (a.z() + b.z()) / 2}, 55);
    }
  }
}

void shell(Furnishing& furnish) {
  const auto roof = [&](const Area& area, double z_m) { furnish.slabs(area, z_m, 35); };
  furnish.slabs({{0, 0}, {kSite_m, kSite_m}}, 0, 30);
  roof({{0, kTurbineHallY}, {kSite_m, kSite_m}}, kTurbineHallRoof_m);
  roof({{0, 0}, {kBoilerHallX, kSouthHallsY}}, kBoilerHallRoof_m);
  roof({{kStoresX, 0}, {kSite_m, kSouthHallsY}}, kStoresRoof_m);
  roof({{0, kSouthHallsY}, {kSite_m, kTurbineHallY}}, kCeiling_m);
  constexpr double kThick_m = 0.4;
  furnish.wall({{0, -kThick_m}, {kSite_m, 0}}, kBoilerHallRoof_m, 60);
  furnish.wall({{0, kSite_m}, {kSite_m, kSite_m + kThick_m}}, kTurbineHallRoof_m, 60);
  furnish.wall({{-kThick_m, 0}, {0, kSite_m}}, kTurbineHallRoof_m, 60);
  furnish.wall({{kSite_m, 0}, {kSite_m + kThick_m, kSite_m}}, kTurbineHallRoof_m, 60);
  furnish.wall({{0, kNorthCorridorY}, {kSite_m, kTurbineHallY}}, kTurbineHallRoof_m, 65);
  furnish.wall({{0, kSouthHallsY}, {kSite_m, kSouthCorridorY}}, kBoilerHallRoof_m, 65);
  furnish.wall({{kBoilerHallX, 0}, {kStoresX, kSouthHallsY}}, kBoilerHallRoof_m, 65);
  for (const auto& [from_x, to_x] : {std::pair{0.0, 8.0}, {11.0, 50.5}, {53.5, 89.0}, {92.0, 100.0}}) { // rooms
    furnish.wall({{from_x, kBlocksTopY - kThick_m}, {to_x, kBlocksTopY}}, kCeiling_m, 62);
    furnish.wall({{from_x, kBlocksBottomY}, {to_x, kBlocksBottomY + kThick_m}}, kCeiling_m, 62);
    furnish.wall({{from_x, kBlocksBottomY}, {from_x + kThick_m, kBlocksTopY}}, kCeiling_m, 62);
    furnish.wall({{to_x - kThick_m, kBlocksBottomY}, {to_x, kBlocksTopY}}, kCeiling_m, 62);
  }
}

/// Adds a few widely spaced door frames and a cable tray: corridors are nearly bare.
void corridor(SceneBuilder& build, Furnishing& furnish, const Roads& roads, Dice& dice, double from_y, double to_y) {
  for (const double wall_y : {from_y, to_y}) {
    const double in = wall_y == from_y ? 0.12 : -0.12;
    for (double x = dice.between(2, 8); x < kSite_m - 2; x += dice.between(6, 16)) {
      if (roads.distance_m({x, wall_y}) < 1.3 || roads.distance_m({x + 1, wall_y}) < 1.3)
        continue;
      for (const double post_x : {x, x + 1.0})
        build.box({post_x, std::min(wall_y, wall_y + in), 0}, {post_x + 0.1, std::max(wall_y, wall_y + in), 2.1}, 80);
      if (dice.chance(0.3))
        build.cylinder({x + 1.6, wall_y + 1.2 * in, 0.5}, 0.09, 0.5, 120); // fire extinguisher
    }
  }
  furnish.pipes({0.2, from_y + 0.3, kCeiling_m - 0.5}, {kSite_m - 0.2, from_y + 0.3, kCeiling_m - 0.5}, 1);
}

void turbine(SceneBuilder& build, Dice& dice, double x, double y) {
  const double length = dice.between(15, 18), axis_z = dice.between(3.2, 3.8);
  build.turned_box({x + length / 2, y, 0}, {length + 2, 6.5, 1.2}, dice.between(-0.01, 0.01), 45);
  build.pipe({x, y, axis_z}, {x + 0.55 * length, y, axis_z}, 2.1, 95);
  build.pipe({x + 0.55 * length, y, axis_z}, {x + 0.62 * length, y, axis_z}, 0.4, 70);
  build.turned_box({x + 0.8 * length, y, 1.2}, {0.35 * length, 3.4, dice.between(3, 3.6)}, 0, 110);
  for (const double along : {0.1, 0.3, 0.45}) {
    build.pipe({x + along * length, y + 1.5, axis_z + 1}, {x + along * length, y + 3, 12}, dice.between(0.3, 0.5), 75);
    build.cylinder({x + along * length, y - 2.4, 1.2}, 0.25, dice.between(1.5, 3), 100);
  }
}

void turbine_hall(SceneBuilder& build, Furnishing& furnish, const Roads& roads, Dice& dice) {
  for (const double x : {11.0, 41.0, 71.5})
    turbine(build, dice, x + dice.between(-0.5, 0.5), 80 + dice.between(-1, 1));
  for (const double y : {62.6, 99.2})
    for (double x = 3; x < kSite_m; x += dice.between(5.6, 6.4))
      if (roads.distance_m({x, y}) > 1.6)
        build.turned_box({x, y, 0}, {0.5, 0.6, kTurbineHallRoof_m}, 0, 70);
  for (double x = 4; x < kSite_m; x += dice.between(7.5, 8.5)) // roof beams
    build.box({x, kTurbineHallY, 18.4}, {x + 0.4, kSite_m, 19.4}, 40);
  for (const double y : {64.0, 98.5}) // crane rails and the crane
    build.box({0, y, 14.5}, {kSite_m, y + 0.4, 15.2}, 55);
  const double crane_x = dice.between(20, 80);
  build.box({crane_x, 64, 15.2}, {crane_x + 1.8, 98.9, 16.6}, 150);
  furnish.pipes({0.5, 99.3, 5}, {99.5, 99.3, 5}, 3);
  furnish.clutter({{8, 70}, {92, 91}}, 70, 2.5);
  furnish.clutter({{1, 96.5}, {99, 99}}, 25, 1.2);
  furnish.clutter({{1, 63}, {99, 65}}, 25, 1.0);
  ramp(build, {{37, 92.2}, {65, 97}}, true);
  furnish.railing({49, 92.4, kHump_m}, {53, 92.4, kHump_m});
  furnish.railing({49, 96.8, kHump_m}, {53, 96.8, kHump_m});
  furnish.forklift({10, 69.8}, {31, 69.8});
  furnish.person({39, 91}, {62, 90.5});
  furnish.person({84, 70}, {91, 88});
}

void boiler_hall(SceneBuilder& build, Furnishing& furnish, Dice& dice) {
  build.box({10, 8, 0}, {16.5, 15, 11}, 60); // boilers
  build.box({24, 7, 0}, {32, 14.5, 12.5}, 60);
  build.box({23.2, 21.5, 0}, {31, 27, 9}, 75);
  for (const double y : {7.0, 12.0, 17.5, 24.0})
    build.cylinder({45 + dice.between(-1, 1), y, 0}, dice.between(1.2, 2.3), dice.between(4, 9),
                   dice.brightness(60, 120));
  for (const double x : {12.0, 15.5, 26.0, 30.0}) // flues
    build.pipe({x, 12, 10.5}, {x + dice.between(-1, 1), 34, 13}, dice.between(0.4, 0.7), 80);
  ramp(build, {{2.7, 6}, {7.2, 24}}, false);
  build.box({1, 24, 0}, {13, 35, kPlatform_m}, 50);
  ramp(build, {{13, 28.5}, {30.2, 34.5}}, true);
  furnish.railing({7.2, 24.1, kPlatform_m}, {12.9, 24.1, kPlatform_m});
  furnish.railing({12.9, 24.1, kPlatform_m}, {12.9, 28.3, kPlatform_m});
  furnish.railing({1.2, 34.8, kPlatform_m}, {12.9, 34.8, kPlatform_m});
  furnish.pipes({0.4, 0.4, 3.2}, {57, 0.4, 3.2}, 4);
  furnish.pipes({57.4, 1, 2.5}, {57.4, 17, 2.5}, 2);
  furnish.clutter({{9, 6}, {52, 29}}, 70, 2.2);
  furnish.clutter({{10, 0.7}, {57, 2.2}}, 25, 0.9);
  furnish.clutter({{32, 33}, {57, 37.5}}, 20, 1.2);
  furnish.person({40, 8}, {40, 27});
}

void stores(SceneBuilder& build, Furnishing& furnish, Dice& dice) {
  for (double x = 70; x < 90; x += dice.between(4.2, 5.2)) { // racks, with full or empty bays
    for (double y = 10; y < 27; y += 2.8) {
      for (const double z : {0.1, 2.1, 4.1}) {
        build.turned_box({x, y + 1.3, z}, {1.1, 2.7, 0.06}, 0, 45);
        if (dice.chance(0.7))
          build.turned_box({x, y + dice.between(0.8, 1.6), z + 0.06},
                           {dice.between(0.6, 1), dice.between(0.8, 1.4), dice.between(0.5, 1.6)},
                           dice.between(-0.05, 0.05), dice.brightness(30, 130));
      }
      for (const double aside : {-0.5, 0.5})
        build.turned_box({x + aside, y, 0}, {0.08, 0.08, 6}, 0, 60);
    }
  }
  furnish.clutter({{61, 1}, {99, 4}}, 30, 1.4);
  furnish.clutter({{61, 34}, {99, 37.5}}, 30, 1.4);
  furnish.clutter({{96, 2}, {99.5, 36}}, 20, 1.0);
  furnish.person({68.2, 9}, {68.2, 29});
}

} // namespace

World make_urban(std::uint64_t seed) {
  Dice dice(seed);
  Roads site_roads = roads();
  SceneBuilder build;
  Furnishing furnish(build, site_roads, dice);
  shell(furnish);
  corridor(build, furnish, site_roads, dice, kBlocksTopY, kNorthCorridorY);
  corridor(build, furnish, site_roads, dice, kSouthCorridorY, kBlocksBottomY);
  turbine_hall(build, furnish, site_roads, dice);
  boiler_hall(build, furnish, dice);
  stores(build, furnish, dice);
  return {.scene = build.scene(),
          .roads = std::move(site_roads),
          .ground_m = ground_m,
          .terrain = {.height_m = 0.004, .tilt_rad = 0.004, .wavelength_m = 3.1},
          .max_speed_mps = 1.5};
}

} // namespace locus::sim
