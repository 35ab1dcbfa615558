// SPDX-License-Identifier: Apache-2.0
#include "core/odometry/flat_ground.hpp"

#include <cmath>

#include "core/odometry/gravity.hpp"

namespace locus {

namespace {

constexpr double kLevel_rad = 0.03;                       ///< 1.7 degrees
constexpr Duration kLongEnough = std::chrono::seconds{2}; ///< continuously level, before the ground counts as flat

/// Deviation from flat ground while the base appears level, one standard deviation.
constexpr double kRipple_m = 0.005; ///< from sweep to sweep
constexpr double kTilt_rad = 0.5 * kLevel_rad;

} // namespace

void FlatGroundAssumption::observe(Stamp stamp, const std::optional<Eigen::Vector3d>& up_base) {
  const bool level = up_base && (level_rpy_rad(*up_base).array().abs() < kLevel_rad).all();
  if (!level)
    level_since_.reset();
  else if (!level_since_)
    level_since_ = stamp;
  found_ = level_since_ && stamp - *level_since_ >= kLongEnough;
}

Pose FlatGroundAssumption::flatten(const Pose& T_odom_last, const Pose& T_odom_base, const Matrix6& information) const {
  const auto share = [&](int axis, double sigma) {
    return mode_ == FlatGround::on ? 1.0 : 1.0 / (1.0 + sigma * sigma * information(axis, axis));
  };
  const Eigen::Vector3d ahead = T_odom_base.rotation * Eigen::Vector3d::UnitX();
  const Eigen::Quaterniond level = from_rpy_rad({0.0, 0.0, std::atan2(ahead.y(), ahead.x())});
  const Eigen::Vector3d righting_rad = so3_log(level * T_odom_base.rotation.conjugate());
  const Eigen::Vector3d shares{share(3, kTilt_rad), share(4, kTilt_rad), 1.0};
  Pose flat = T_odom_base;
  flat.translation.z() += share(2, kRipple_m) * (T_odom_last.translation.z() - T_odom_base.translation.z());
  flat.rotation = (so3_exp(shares.cwiseProduct(righting_rad)) * T_odom_base.rotation).normalized();
  return flat;
}

} // namespace locus
