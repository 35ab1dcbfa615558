// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>

#include "locus_sim/scene_builder.hpp"

namespace locus::sim {

/// Adds the zero level set of a function of space, as triangles of about `cell_m`, inside the bounds only. The
/// function, evaluated in columns from bottom to top, should have a slope of about one per metre near its zero, and the
/// right sign elsewhere: positive in air, negative in rock.
///
/// Naive surface nets: one vertex in every cell that the surface crosses, at the mean of the crossings of its edges;
/// one pair of triangles around every lattice edge that it crosses.
void add_surface(SceneBuilder& build, const Bounds& bounds, double cell_m,
                 const std::function<double(const Eigen::Vector3d&)>& air, std::uint8_t bright);

} // namespace locus::sim
