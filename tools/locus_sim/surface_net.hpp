// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>

#include "locus_sim/scene_builder.hpp"

namespace locus::sim {

/// Adds the surface on which a function of space is zero, as triangles about `cell_m` large. Inside the bounds alone.
/// The function, asked for in columns from below to above, should change by about one per metre near its zero, and tell
/// air (above zero) from rock elsewhere.
///
/// Naive surface nets: one vertex in every cell that the surface crosses, at the mean of the crossings of its edges;
/// one pair of triangles about every edge of the lattice that it crosses.
void add_surface(SceneBuilder& build, const Bounds& bounds, double cell_m,
                 const std::function<double(const Eigen::Vector3d&)>& air, std::uint8_t bright);

} // namespace locus::sim
