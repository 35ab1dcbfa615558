// SPDX-License-Identifier: Apache-2.0
#include "core/flat_ground.hpp"

#include <cmath>

namespace locus {

namespace {

constexpr double kLevel_rad = 0.03;                       ///< 1.7 degrees
constexpr Duration kLongEnough = std::chrono::seconds{2}; ///< level all along, before the ground counts as flat

} // namespace

Eigen::Vector3d level_rpy_rad(const Eigen::Vector3d& specific_force_base_mps2) {
  const Eigen::Vector3d& f = specific_force_base_mps2;
  return {std::atan2(f.y(), f.z()), std::atan2(-f.x(), std::hypot(f.y(), f.z())), 0.0};
}

void FlatGroundAssumption::observe(Stamp stamp, const std::optional<Eigen::Vector3d>& specific_force_base_mps2) {
  const bool level =
      specific_force_base_mps2 && (level_rpy_rad(*specific_force_base_mps2).array().abs() < kLevel_rad).all();
  if (!level)
    level_since_.reset();
  else if (!level_since_)
    level_since_ = stamp;
  found_ = level_since_ && stamp - *level_since_ >= kLongEnough;
}

Pose FlatGroundAssumption::flatten(const Pose& T_odom_last, const Pose& T_odom_base) {
  const Eigen::Vector3d ahead = T_odom_base.rotation * Eigen::Vector3d::UnitX();
  Pose flat = T_odom_base;
  flat.translation.z() = T_odom_last.translation.z();
  flat.rotation = from_rpy_rad({0.0, 0.0, std::atan2(ahead.y(), ahead.x())});
  return flat;
}

} // namespace locus
