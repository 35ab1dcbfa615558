// SPDX-License-Identifier: Apache-2.0
#include "core/odometry/joint_covariance.hpp"

namespace locus {

void JointCovariance::reset(int begin, const Eigen::Ref<const Eigen::MatrixXd>& covariance) {
  const Eigen::Index count = covariance.rows();
  P_.middleRows(begin, count).setZero();
  P_.middleCols(begin, count).setZero();
  P_.block(begin, begin, count, count) = covariance;
}

void JointCovariance::propagate(const Common& F) {
  const Eigen::Index own = P_.rows() - kCommonStates;
  P_.topLeftCorner<kCommonStates, kCommonStates>() =
      (F * P_.topLeftCorner<kCommonStates, kCommonStates>() * F.transpose()).eval();
  P_.topRightCorner(kCommonStates, own) = (F * P_.topRightCorner(kCommonStates, own)).eval();
  P_.bottomLeftCorner(own, kCommonStates) = P_.topRightCorner(kCommonStates, own).transpose();
}

/// Eq. 4 in docs/estimator.md.
void JointCovariance::revert(int state, double retained, double variance) {
  P_.row(state) *= retained;
  P_.col(state) *= retained;
  P_(state, state) += (1.0 - retained * retained) * variance;
}

/// Eq. 8 in docs/estimator.md.
void JointCovariance::condition(const State& Ph, const State& considered, double innovation_variance) {
  P_ -= (Ph * Ph.transpose() - considered * considered.transpose()) / innovation_variance;
  P_ = (0.5 * (P_ + P_.transpose())).eval();
}

} // namespace locus
