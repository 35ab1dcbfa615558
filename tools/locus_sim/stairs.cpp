// SPDX-License-Identifier: Apache-2.0
#include "locus_sim/furnishing.hpp"
#include "locus_sim/world.hpp"

namespace locus::sim {
namespace {

constexpr int kSteps = 17; // per flight
constexpr double kTread_m = 0.29, kRise_m = 0.175;
constexpr double kFlight_m = kSteps * kTread_m, kStorey_m = kSteps * kRise_m;
constexpr double kCorridor_m = 20, kLandingX = kFlight_m + 2.6;

// The first flight climbs along x, the second one, beside it, climbs back.
constexpr double kFirstY = -1.4, kBetweenY = 1.4, kSecondY = 1.8, kEndY = 4.6;
constexpr double kCeiling_m = 2.7;

Jet ground_m(const Jet& x, const Jet& y) {
  const Jet flight = ramp(x, kFlight_m, 0.7);
  const Jet second = ease((y - kBetweenY) * (1 / (kSecondY - kBetweenY)));
  return kStorey_m * (flight + second * (2.0 - 2.0 * flight));
}

void flights(SceneBuilder& build) {
  for (int i = 0; i < kSteps; ++i) {
    const double x = i * kTread_m, low = (i + 1) * kRise_m, high = 2 * kStorey_m - i * kRise_m;
    build.box({x, kFirstY, low - kRise_m}, {x + kTread_m + 0.02, kBetweenY, low}, 50);
    build.box({x, kSecondY, high - kRise_m}, {x + kTread_m + 0.02, kEndY, high}, 50);
  }
}

/// Builds a corridor with unevenly spaced door frames.
void corridor(SceneBuilder& build, Furnishing& furnish, Dice& dice, const Area& area, double floor_z) {
  furnish.slabs(area, floor_z, 30);
  furnish.slabs(area, floor_z + kCeiling_m, 60);
  for (const double y : {area.min_m.y(), area.max_m.y()}) {
    build.rectangle({area.min_m.x(), y, floor_z}, {area.max_m.x() - area.min_m.x(), 0, 0}, {0, 0, kCeiling_m}, 60);
    const double in = y == area.min_m.y() ? 0.1 : -0.1;
    for (double x = area.min_m.x() + dice.between(1, 4); x < area.max_m.x() - 1.5; x += dice.between(3, 6))
      for (const double post_x : {x, x + 0.95})
        build.turned_box({post_x, y + in / 2, floor_z}, {0.1, 0.1, 2.1}, 0, 85);
  }
}

void stairwell(SceneBuilder& build, Furnishing& furnish) {
  const double top = 2 * kStorey_m + kCeiling_m;
  const Eigen::Vector3d along{kLandingX, 0, 0}, across{0, kEndY - kFirstY, 0}, up{0, 0, top};
  build.rectangle({0, kFirstY, 0}, along, up, 62);
  build.rectangle({0, kEndY, 0}, along, up, 62);
  build.rectangle({0, kFirstY, top}, along, across, 60);
  furnish.slabs({{kFlight_m, kFirstY}, {kLandingX, kEndY}}, kStorey_m, 40);
  build.rectangle({0, kFirstY, kCeiling_m}, {0, kBetweenY - kFirstY, 0}, {0, 0, top - kCeiling_m}, 62);
  build.rectangle({0, kBetweenY, 0}, {0, kEndY - kBetweenY, 0}, {0, 0, 2 * kStorey_m}, 62);
  // Beyond the landing the middle storey continues behind its doorway.
  build.rectangle({kLandingX, kBetweenY, 0}, {0, kEndY - kBetweenY, 0}, up, 62);
  build.rectangle({kLandingX, kFirstY, 0}, {0, kBetweenY - kFirstY, 0}, {0, 0, kStorey_m}, 62);
  build.rectangle({kLandingX, kFirstY, kStorey_m + kCeiling_m}, {0, kBetweenY - kFirstY, 0},
                  {0, 0, top - kStorey_m - kCeiling_m}, 62);
  furnish.railing({0, kBetweenY + 0.1, 0}, {kFlight_m, kBetweenY + 0.1, kStorey_m});
  furnish.railing({0, kSecondY - 0.1, 2 * kStorey_m}, {kFlight_m, kSecondY - 0.1, kStorey_m});
}

} // namespace

World make_stairs(std::uint64_t seed) {
  Dice dice(seed);
  Roads roads;
  constexpr double kFirst = (kFirstY + kBetweenY) / 2, kSecond = (kSecondY + kEndY) / 2;
  constexpr double kOnLanding = kFlight_m + 1.4;
  roads.add({{2 - kCorridor_m, kFirst}, {-1.2, kFirst}, {kOnLanding, kFirst}, {kLandingX + kCorridor_m - 2, kFirst}});
  roads.add({{kOnLanding, kFirst}, {kOnLanding, kSecond}, {-1.2, kSecond}, {2 - kCorridor_m, kSecond}});
  SceneBuilder build;
  Furnishing furnish(build, roads, dice);
  flights(build);
  stairwell(build, furnish);
  corridor(build, furnish, dice, {{-kCorridor_m, kFirstY}, {0, kBetweenY}}, 0);
  corridor(build, furnish, dice, {{kLandingX, kFirstY}, {kLandingX + kCorridor_m, kBetweenY}}, kStorey_m);
  corridor(build, furnish, dice, {{-kCorridor_m, kSecondY}, {0, kEndY}}, 2 * kStorey_m);
  for (const auto& [x, y, z] : {std::array{-kCorridor_m, kFirstY, 0.0},
                                {kLandingX + kCorridor_m, kFirstY, kStorey_m},
                                {-kCorridor_m, kSecondY, 2 * kStorey_m}}) // ends of the corridors
    build.rectangle({x, y, z}, {0, kBetweenY - kFirstY, 0}, {0, 0, kCeiling_m}, 55);
  return {.scene = build.scene(),
          .roads = std::move(roads),
          .ground_m = ground_m,
          .terrain = {.height_m = 0.003, .tilt_rad = 0.004, .wavelength_m = 2.9},
          .max_speed_mps = 0.6};
}

} // namespace locus::sim
