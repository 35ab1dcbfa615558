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
  Ground ground_m; ///< beneath the roads; none: level at 0
  Terrain terrain; ///< how uneven it is beneath that
};

using WorldMaker = World (*)(std::uint64_t seed);

/// Power plant, 100 x 100 x 20 m: three halls with machines, tanks, pipes and racks, bare corridors between them, two
/// ramps, people and a forklift at work.
World make_urban(std::uint64_t seed);

/// A world by its name on the command line. The seed moves what is movable; the site stays the same.
struct NamedWorld {
  std::string_view name;
  WorldMaker make;
};
inline constexpr std::array kWorlds{NamedWorld{"urban", make_urban}};

} // namespace locus::sim
