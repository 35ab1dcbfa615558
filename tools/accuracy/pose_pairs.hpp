// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "drivers/files/motion_files.hpp"

namespace locus {

/// An estimate and the true pose at the same instant.
struct PosePair {
  std::size_t estimate; ///< index
  Stamp stamp;
  Pose T_odom_base;
  Pose T_truth_base;
};

/// Pairs the estimates whose stamps the truth spans. True poses are interpolated, but not across a gap much longer than
/// their usual interval. Both inputs are sorted by time.
std::vector<PosePair> paired(std::span<const StampedPose> estimates, std::span<const StampedPose> truth);

/// Section between two pairs, of a certain length along the true path.
struct Stretch {
  std::size_t begin, end; ///< indices of the pairs
  double length_m;
};

/// Returns all stretches that begin at a pair and end at the first one at least `length_m` farther along the path.
std::vector<Stretch> stretches_of(std::span<const PosePair> pairs, double length_m);

} // namespace locus
