// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "locus_replay/output_file.hpp"
#include "locus_sim/scene.hpp"
#include "locus_sim/seen_space.hpp"

namespace locus::sim {

/// Writes the surfaces of a scene as points in world frame, one per 3 cm or denser, as far as they lie in
/// cubes of which something was seen: gt_map.ply, binary. What moves is not part of it. Throws Failure when it cannot
/// write.
void write_truth_map(tools::OutputFile& file, const Scene& scene, const SeenSpace& seen);

} // namespace locus::sim
