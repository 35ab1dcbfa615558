// SPDX-License-Identifier: Apache-2.0
#include "core/odometry/observed_axes.hpp"

#include <algorithm>
#include <functional>

namespace locus {

Vector6 ObservedAxes::observe(const Matrix6& observability_base) {
  constexpr double kSolvable = 1e-6; ///< makes an unobserved axis invertible
  const Matrix6 solvable = observability_base + kSolvable * Matrix6::Identity();
  Vector6 observability = solvable.inverse().diagonal().cwiseInverse().cwiseMin(1.0);
  for (std::size_t axis = 0; axis < observed_.size(); ++axis)
    observed_[axis] = observability[static_cast<Eigen::Index>(axis)] >= (observed_[axis] ? kWeakBelow : kObservedFrom);
  return observability;
}

bool ObservedAxes::all() const { return std::ranges::all_of(observed_, std::identity{}); }

Vector6 ObservedAxes::part_of(Vector6 along_base) const {
  for (std::size_t axis = 0; axis < observed_.size(); ++axis)
    if (!observed_[axis])
      along_base[static_cast<Eigen::Index>(axis)] = 0.0;
  return along_base;
}

} // namespace locus
