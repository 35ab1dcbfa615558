// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "drivers/files/motion_files.hpp"

namespace locus {

/// An estimate, and the truth at the same instant.
struct PosePair {
  std::size_t estimate; ///< which
  Stamp stamp;
  Pose T_odom_base;
  Pose T_truth_base;
};

/// The estimates whose stamps the truth spans. Between true poses it is interpolated, but not across a hole much longer
/// than their usual interval. Both in the order of time.
std::vector<PosePair> paired(std::span<const StampedPose> estimates, std::span<const StampedPose> truth);

/// From one pair to another a certain length of the true path farther on.
struct Stretch {
  std::size_t begin, end; ///< of the pairs
  double length_m;
};

/// All stretches that begin at a pair and end at the first one at least `length_m` farther on.
std::vector<Stretch> stretches_of(std::span<const PosePair> pairs, double length_m);

} // namespace locus
