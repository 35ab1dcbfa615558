// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "locus_replay/output_file.hpp"
#include "locus_sim/observed_space.hpp"
#include "locus_sim/scene.hpp"

namespace locus::sim {

/// Writes the surfaces of a scene as points in world frame, spaced 3 cm or less, within observed cubes: gt_map.ply,
/// binary. Excludes moving objects. Throws Failure if it cannot write.
void write_truth_map(tools::OutputFile& file, const Scene& scene, const ObservedSpace& observed);

} // namespace locus::sim
