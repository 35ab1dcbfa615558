// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "locus_sim/scene.hpp"
#include "locus_sim/trajectory.hpp"

namespace locus::sim {

/// Ready-made worlds. The floor is z = 0 unless stated otherwise. A seed always gives the same scene.

/// 10 x 8 x 4 m around the origin, with some furniture. The middle 4 x 4 m are free.
Scene room();

enum class Walls { bare, pillars }; ///< bare: the position along the corridor is unobservable

/// Corridor along x from 0 to `length_m`, 3 m wide around y = 0, 3 m high, closed at both ends. Pillars and door frames
/// stand at uneven distances; the middle 1.6 m are free.
Scene corridor(double length_m, Walls walls = Walls::pillars);

/// Tunnel along x from 0 to `length_m`, about 5 m wide around y = 0 and 4 m high, of self-similar rough rock. The
/// middle 3 m are free.
Scene tunnel(double length_m, std::uint64_t seed = 1);

/// A street along x from -50 m to `length_m` + 50 m: houses with gaps, parked cars, poles, trees. The middle 6 m are
/// free.
Scene street(double length_m, std::uint64_t seed = 1);

/// The ground floor of a small power plant: two halls of 24 x 20 m, full of machines and pillars, and two corridors
/// between them.
Scene plant();

/// Course around the plant for at least `at_least`: through both halls, both corridors and between the machines.
Course plant_course(Duration at_least, double speed_mps);

/// Start of plant_course().
Start plant_start();

/// Laps of 2.4 x 2.4 m in the middle of room(), at 2 rad/s in the corners; begins at room_start().
Course room_course(Duration at_least, double speed_mps);
Start room_start();

/// Course along x from its Start, weaving by `aside_m` to either side over `wave_m`, for at least the requested time.
Course weaving_course(Duration at_least, double speed_mps, double aside_m, double wave_m);
Start weaving_start(double x_m, double aside_m, double wave_m);

} // namespace locus::sim
