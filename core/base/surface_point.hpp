// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

namespace locus {

/// A point with what is known of the surface under it.
struct SurfacePoint {
  Eigen::Vector3f position_m;
  Eigen::Vector3f normal; ///< unit, or zero where there is none to be trusted
};

} // namespace locus
