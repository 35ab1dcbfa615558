// SPDX-License-Identifier: Apache-2.0
#include "core/odometry/seen_axes.hpp"

#include <algorithm>
#include <functional>

namespace locus {

Vector6 SeenAxes::observe(const Matrix6& observability_base) {
  constexpr double kSolvable = 1e-6; ///< makes an unobserved axis invertible
  const Matrix6 solvable = observability_base + kSolvable * Matrix6::Identity();
  Vector6 observability = solvable.inverse().diagonal().cwiseInverse().cwiseMin(1.0);
  for (std::size_t axis = 0; axis < seen_.size(); ++axis)
    seen_[axis] = observability[static_cast<Eigen::Index>(axis)] >= (seen_[axis] ? kWeakBelow : kSeenFrom);
  return observability;
}

bool SeenAxes::all() const { return std::ranges::all_of(seen_, std::identity{}); }

Vector6 SeenAxes::part_of(Vector6 along_base) const {
  for (std::size_t axis = 0; axis < seen_.size(); ++axis)
    if (!seen_[axis])
      along_base[static_cast<Eigen::Index>(axis)] = 0.0;
  return along_base;
}

Matrix6 SeenAxes::rows_of(Matrix6 information_base) const {
  for (std::size_t axis = 0; axis < seen_.size(); ++axis)
    if (!seen_[axis])
      information_base.row(static_cast<Eigen::Index>(axis)).setZero();
  return information_base;
}

} // namespace locus
