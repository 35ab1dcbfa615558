// SPDX-License-Identifier: Apache-2.0
#include "core/flat_ground.hpp"

#include <cmath>

#include "core/gravity.hpp"

namespace locus {

namespace {

constexpr double kLevel_rad = 0.03;                       ///< 1.7 degrees
constexpr Duration kLongEnough = std::chrono::seconds{2}; ///< level all along, before the ground counts as flat

} // namespace

void FlatGroundAssumption::observe(Stamp stamp, const std::optional<Eigen::Vector3d>& up_base) {
  const bool level = up_base && (level_rpy_rad(*up_base).array().abs() < kLevel_rad).all();
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
