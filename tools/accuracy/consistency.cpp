// SPDX-License-Identifier: Apache-2.0
#include "accuracy/consistency.hpp"

#include <Eigen/Cholesky>

#include <algorithm>
#include <cmath>
#include <vector>

#include "accuracy/pose_pairs.hpp"

namespace locus {

namespace {

constexpr double kNoError_m = 0.01;

/// Returns the covariance of the end pose relative to the start pose, odom axes; their errors count as independent.
Matrix6 covariance_between(const PosePair& begin, const PosePair& end, std::span<const Matrix6> covariances) {
  Matrix6 transport = Matrix6::Identity();
  transport.topRightCorner<3, 3>() = -skew(end.T_odom_base.translation - begin.T_odom_base.translation);
  return covariances[end.estimate] + transport * covariances[begin.estimate] * transport.transpose();
}

/// Returns the squared error normalised by its covariance; nothing if the covariance of an axis is zero.
std::optional<double> normalised_squared_error(const PosePair& begin, const PosePair& end,
                                               std::span<const Matrix6> covariances) {
  const Pose T_odom = begin.T_odom_base.inverse() * end.T_odom_base;
  const Pose T_truth = begin.T_truth_base.inverse() * end.T_truth_base;
  const Eigen::Quaterniond& R_odom_begin = begin.T_odom_base.rotation;
  Vector6 error;
  error << R_odom_begin * (T_odom.translation - T_truth.translation),
      R_odom_begin * so3_log(T_odom.rotation * T_truth.rotation.conjugate());
  const Eigen::LLT<Matrix6> covariance(covariance_between(begin, end, covariances));
  if (covariance.info() != Eigen::Success)
    return std::nullopt;
  return error.dot(covariance.solve(error));
}

std::optional<double> nees(std::span<const PosePair> pairs, std::span<const Matrix6> covariances, double length_m) {
  double sum = 0.0, count = 0.0;
  for (const Stretch& stretch : stretches_of(pairs, length_m)) {
    if (const auto error = normalised_squared_error(pairs[stretch.begin], pairs[stretch.end], covariances)) {
      sum += *error;
      count += 1.0;
    }
  }
  return count > 0.0 ? std::optional{sum / count} : std::nullopt;
}

double worst_sigma(std::span<const PosePair> pairs, std::span<const Matrix6> covariances) {
  const Pose T_odom_truth = pairs.front().T_odom_base * pairs.front().T_truth_base.inverse();
  double worst = 0.0;
  for (const PosePair& pair : pairs) {
    const Eigen::Vector3d error_m = pair.T_odom_base.translation - T_odom_truth * pair.T_truth_base.translation;
    if (error_m.norm() < kNoError_m)
      continue;
    const Eigen::Array3d sigma_m = covariances[pair.estimate].diagonal().head<3>().array().sqrt();
    worst = std::max(worst, (error_m.array().abs() / sigma_m).maxCoeff());
  }
  return worst;
}

} // namespace

std::optional<Consistency> consistency(std::span<const StampedPose> estimates, std::span<const Matrix6> covariances,
                                       std::span<const StampedPose> truth) {
  const std::vector<PosePair> pairs = paired(estimates, truth);
  if (pairs.empty())
    return std::nullopt;
  return Consistency{.nees_10m = nees(pairs, covariances, 10.0), .worst_sigma = worst_sigma(pairs, covariances)};
}

} // namespace locus
