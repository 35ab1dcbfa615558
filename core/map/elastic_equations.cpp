// SPDX-License-Identifier: Apache-2.0
#include "core/map/elastic_equations.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>

namespace locus {

namespace {

/// Scale factor of the information, because residuals of one voxel, arc or object are correlated. Smaller if the fit is
/// worse than the surfaces' covariances predict, which differs twentyfold between scenes.
constexpr double kIndependent = 0.06;
constexpr double kBestFit = 0.3; ///< mean squared Mahalanobis distance

/// Noise floor of the normal products (2 sigma): products of as many independent errors reach it by chance. Subtracted
/// from the reported information only (James-Stein). The solution follows it all the same: weak information from a
/// sweep is better than none.
constexpr double kByChance_sigma = 2.0;
constexpr double kNothing = 1e-9; ///< least information

/// Error common to all points of a sweep: of the calibration, of the angle of incidence, and of both in the map.
/// Considered (Schmidt), not estimated. It costs little where a few surfaces face the motion, and leaves nothing along
/// a corridor, where the information comes from a thousand slightly tilted normals.
constexpr double kCommonError_m = 0.001;

constexpr double square(double x) { return x * x; }

/// Applies a matrix of the pose (target axes) to the twist as well (base axes).
Matrix12 pose_and_twist(const Matrix6& of_pose, const Matrix6& R_target_base) {
  Matrix12 both = Matrix12::Zero();
  both.topLeftCorner<6, 6>() = of_pose;
  both.bottomRightCorner<6, 6>() = R_target_base.transpose() * of_pose * R_target_base;
  return both;
}

} // namespace

double honest_share(double mean_error) { return kIndependent / std::max(kBestFit, mean_error); }

void ElasticEquations::complete(const Axes& axes, const Matrix6& R_target_base) {
  H.topLeftCorner<6, 6>() = of_pose.H;
  H.bottomLeftCorner<6, 6>() = H.topRightCorner<6, 6>().transpose();
  b.head<6>() = of_pose.b;
  Matrix6 solved = Matrix6::Zero(), claimed = Matrix6::Zero(); // square roots of the remaining share of information
  const double independent = std::max(1.0, kIndependent * of_pose.weight);
  for (int side = 0; side < 6; ++side) {
    Vector6 axis = Vector6::Unit(side);
    if (side < 3)
      axis.head<3>() = Eigen::Vector3f(axes[static_cast<std::size_t>(side)].data()).cast<double>();
    const double all = std::max(axis.dot(of_pose.H * axis), kNothing);
    const double observed = std::clamp(of_pose.observed[side], kNothing, all);
    const double certain =
        std::max(kNothing, observed - square(kByChance_sigma * all) / independent / observed); // James-Stein
    const double common = square(kCommonError_m * of_pose.sides[side]);
    solved += observed / std::sqrt(all * (observed + common)) * axis * axis.transpose();
    claimed += certain / std::sqrt(all * (certain + common)) * axis * axis.transpose();
  }
  const Matrix12 of_both = pose_and_twist(solved, R_target_base),
                 certain_of_both = pose_and_twist(claimed, R_target_base);
  information = certain_of_both * H * certain_of_both;
  H = (of_both * of_both * H).eval();
  b = (of_both * of_both * b).eval();
  const double honest = honest_share(of_pose.error / std::max(of_pose.weight, 1.0));
  information *= honest;
  H *= honest;
  b *= honest;
}

} // namespace locus
