// SPDX-License-Identifier: Apache-2.0
#include "locus_sim/surroundings.hpp"

#include <cmath>
#include <utility>
#include <vector>

#include "locus_sim/company.hpp"
#include "locus_sim/escort.hpp"

namespace locus::sim {
namespace {

constexpr double kPercent = 0.01;

/// Generates bursts of 2 to 5 s, at random times, within 3 m of the path ahead of the robot, from the floor to the
/// height of a person.
std::vector<Cloud> bursts(const Way& way, double per_min, Dice& dice) {
  constexpr double kStepsPerMin = 600, kNearTheWay_m = 3;
  const double expected = per_min * static_cast<double>(way.steps()) / kStepsPerMin;
  const auto count = static_cast<std::size_t>(expected) + (dice.chance(expected - std::floor(expected)) ? 1 : 0);
  std::vector<Cloud> clouds;
  for (std::size_t i = 0; i < count; ++i) {
    const std::size_t step = dice.below(way.steps());
    const double ahead_s = dice.between(0, 4), x = dice.between(-kNearTheWay_m, kNearTheWay_m),
                 y = dice.between(-kNearTheWay_m, kNearTheWay_m), z = dice.between(0, 1.6),
                 lasts_s = dice.between(2, 5);
    const Eigen::Vector2d near = way.at(step + static_cast<std::size_t>(10 * ahead_s)) + Eigen::Vector2d{x, y};
    const Stamp begin = way.stamp(step);
    clouds.push_back({way.on_ground(near) + Eigen::Vector3d{0, 0, z}, dice.between(0.2, 0.4), dice.between(0.9, 1.7),
                      begin, begin + from_seconds(lasts_s)});
  }
  return clouds;
}

} // namespace

bool surround(World& world, const Robot& robot, const Trajectory& trajectory, const Imperfections& imperfections,
              std::uint64_t seed) {
  constexpr std::uint64_t kVehicle = 1, kPeople = 2, kSteam = 3, kMirrors = 4; // independent random numbers for each
  const auto seed_of = [&](std::uint64_t purpose) { return seed + 0x5EED'0000'0000U * purpose; };
  bool has_room = true;
  const bool moves = imperfections.vehicle_s_per_min > 0 || imperfections.people > 0 || imperfections.steam_per_min > 0;
  if (moves) {
    const Way way(trajectory, robot.reach_m, world.ground_m);
    if (imperfections.vehicle_s_per_min > 0) {
      Dice dice(seed_of(kVehicle));
      auto vehicle = escort(world.scene, way, imperfections.vehicle_s_per_min, dice);
      has_room = vehicle.has_value();
      if (vehicle)
        world.scene.add(std::move(*vehicle));
    }
    Dice dice(seed_of(kPeople)), steam_dice(seed_of(kSteam));
    for (Passer& person : company(world.scene, way, static_cast<std::size_t>(imperfections.people), dice))
      world.scene.add(std::move(person));
    world.scene.add(Steam(bursts(way, imperfections.steam_per_min, steam_dice)));
  }
  if (imperfections.wet_floor_percent > 0 || imperfections.glass_percent > 0)
    world.scene.add(
        Mirrors(kPercent * imperfections.wet_floor_percent, kPercent * imperfections.glass_percent, seed_of(kMirrors)));
  return has_room;
}

} // namespace locus::sim
