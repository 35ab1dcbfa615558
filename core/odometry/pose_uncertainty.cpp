// SPDX-License-Identifier: Apache-2.0
#include "core/odometry/pose_uncertainty.hpp"

#include <Eigen/LU>

namespace locus {

namespace {

/// Keeps a covariance of nothing invertible: a hundredth of a millimetre, and of a milliradian.
constexpr double kLeastVariance = 1e-10;

} // namespace

void PoseUncertainty::Error::carry(const Eigen::Vector3d& moved_m) {
  const Matrix6 further = transport(moved_m);
  noise = further * noise * further.transpose();
  bias = further.cwiseAbs() * bias;
}

Matrix6 PoseUncertainty::Error::covariance() const {
  Matrix6 sum = noise;
  sum.diagonal() += bias.cwiseAbs2();
  return sum;
}

void PoseUncertainty::predict(const Eigen::Vector3d& moved_m, const Matrix6& noise, const Vector6& bias) {
  of_map_.carry(moved_m);
  of_sweep_.carry(moved_m);
  of_sweep_.noise += noise;
  of_sweep_.bias += bias;
}

void PoseUncertainty::see(const Matrix6& lidar_information) {
  const Matrix6 known = (against_submap() + kLeastVariance * Matrix6::Identity()).inverse();
  const Matrix6 after = (known + lidar_information).inverse();
  const Matrix6 kept = after * known; // of the error before
  of_sweep_.noise = kept * of_sweep_.noise * kept.transpose() + after * lidar_information * after;
  of_sweep_.bias = kept.cwiseAbs() * of_sweep_.bias;
}

void PoseUncertainty::keep(const Matrix6& share) {
  const Matrix6 left = Matrix6::Identity() - share;
  of_map_.noise += share * of_sweep_.noise * share.transpose();
  of_map_.bias += share.cwiseAbs() * of_sweep_.bias;
  of_sweep_.noise = left * of_sweep_.noise * left.transpose();
  of_sweep_.bias = left.cwiseAbs() * of_sweep_.bias;
}

Matrix6 PoseUncertainty::against_submap() const { return of_sweep_.covariance(); }

Matrix6 PoseUncertainty::since_start() const {
  Error sum = of_map_;
  sum.noise += of_sweep_.noise;
  sum.bias += of_sweep_.bias;
  return sum.covariance();
}

} // namespace locus
