// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "core/base/pose.hpp"
#include "core/map/gicp_kernel.hpp"
#include "core/map/registration.hpp"

namespace locus {

/// Returns the scale factor of the information of points, eta of eq. 10 in docs/estimator.md. `mean_error`: their mean
/// squared Mahalanobis distance.
double honest_share(double mean_error);

/// Normal equations of pose and twist, along the axes of Vector12 (m, rad, m/s, rad/s): add() for each block of points,
/// then complete(). `R_target_base`: turn_both() of the base's orientation.
struct ElasticEquations {
  Matrix12 H = Matrix12::Zero(); ///< after complete(): of the equations to be solved, not symmetric
  Matrix12 information;          ///< of the points, set by complete()
  Vector12 b = Vector12::Zero();
  NormalEquations of_pose; ///< sums over the blocks

  /// Eq. 9 in docs/estimator.md. Adds the equations of a block of points that are `age_s` old.
  void add(const NormalEquations& block, double age_s, const Matrix6& R_target_base) {
    of_pose += block;
    if (age_s == 0.0)
      return;
    const Matrix6 across = -age_s * block.H * R_target_base;
    H.topRightCorner<6, 6>() += across;
    H.bottomRightCorner<6, 6>() -= age_s * R_target_base.transpose() * across;
    b.tail<6>() -= age_s * R_target_base.transpose() * block.b;
  }
  /// Eq. 10 in docs/estimator.md. `axes`: those along which the sums of NormalEquations are taken.
  void complete(const Axes& axes, const Matrix6& R_target_base);
};

} // namespace locus
