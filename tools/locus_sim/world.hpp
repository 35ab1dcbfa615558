// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <string_view>

#include "locus_sim/roads.hpp"
#include "locus_sim/scene.hpp"
#include "locus_sim/trajectory.hpp"

namespace locus::sim {

/// A place with all that a simulated robot needs to know of it.
struct World {
  Scene scene;
  Roads roads;
  Ground ground_m;      ///< beneath the roads; none: level at 0
  Terrain terrain;      ///< how uneven it is beneath that
  double max_speed_mps; ///< that a sensible driver goes at
};

using WorldMaker = World (*)(std::uint64_t seed);

/// Power plant, 100 x 100 x 20 m: three halls with machines, tanks, pipes and racks, bare corridors between them, two
/// ramps, people and a forklift at work.
World make_urban(std::uint64_t seed);

/// Mine, 200 x 200 x 10 m: drifts and crosscuts of rough rock that look alike everywhere, uphill and downhill.
World make_tunnel(std::uint64_t seed);

/// 100 m of bare walls, floor and ceiling, closed by dark doors: nothing tells where along it one is.
World make_corridor(std::uint64_t seed);

/// Rolling meadow, 240 x 240 m, with a few trees, bushes, rocks, fences and a barn.
World make_field(std::uint64_t seed);

/// Stairs of two flights between corridors on three storeys.
World make_stairs(std::uint64_t seed);

/// A road of several lanes round a small town, 2.2 km: houses, trees, poles, guard rails, parked cars; others drive
/// too, some the same way.
World make_road(std::uint64_t seed);

/// A world by its name on the command line. The seed moves what is movable; the site stays the same.
struct NamedWorld {
  std::string_view name;
  WorldMaker make;
};
inline constexpr std::array kWorlds{NamedWorld{"urban", make_urban},       NamedWorld{"tunnel", make_tunnel},
                                    NamedWorld{"corridor", make_corridor}, NamedWorld{"field", make_field},
                                    NamedWorld{"stairs", make_stairs},     NamedWorld{"road", make_road}};

} // namespace locus::sim
