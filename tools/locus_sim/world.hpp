// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <string_view>

#include "locus_sim/roads.hpp"
#include "locus_sim/scene.hpp"
#include "locus_sim/trajectory.hpp"

namespace locus::sim {

/// World with everything that a simulated robot needs.
struct World {
  Scene scene;
  Roads roads;
  Ground ground_m;      ///< below the roads; none: level at 0
  Terrain terrain;      ///< roughness on top of it
  double max_speed_mps; ///< of a sensible driver
};

using WorldMaker = World (*)(std::uint64_t seed);

/// Builds a power plant, 100 x 100 x 20 m: three halls with machines, tanks, pipes and racks, bare corridors between
/// them, two ramps, people and a forklift at work.
World make_urban(std::uint64_t seed);

/// Builds a mine, 200 x 200 x 10 m: sloping drifts and crosscuts of rough rock that look alike everywhere.
World make_tunnel(std::uint64_t seed);

/// Builds a corridor of 100 m: bare walls, floor and ceiling, closed by dark doors, without features along it.
World make_corridor(std::uint64_t seed);

/// Builds a rolling meadow, 240 x 240 m, with a few trees, bushes, rocks, fences and a barn.
World make_field(std::uint64_t seed);

/// Builds stairs of two flights between corridors on three storeys.
World make_stairs(std::uint64_t seed);

/// Builds a multi-lane road around a small town, 2.2 km: houses, trees, poles, guard rails, parked cars, and traffic,
/// partly in the robot's direction.
World make_road(std::uint64_t seed);

/// World with its name on the command line. The seed moves what is movable; the site stays the same.
struct NamedWorld {
  std::string_view name;
  WorldMaker make;
};
inline constexpr std::array kWorlds{NamedWorld{"urban", make_urban},       NamedWorld{"tunnel", make_tunnel},
                                    NamedWorld{"corridor", make_corridor}, NamedWorld{"field", make_field},
                                    NamedWorld{"stairs", make_stairs},     NamedWorld{"road", make_road}};

} // namespace locus::sim
