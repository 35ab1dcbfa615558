// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

namespace locus {

/// Point with the normal of the surface it lies on.
struct SurfacePoint {
  Eigen::Vector3f position_m;
  Eigen::Vector3f normal; ///< unit, or zero if there is no reliable one
};

} // namespace locus
