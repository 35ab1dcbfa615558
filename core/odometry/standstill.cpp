// SPDX-License-Identifier: Apache-2.0
#include "core/odometry/standstill.hpp"

namespace locus {

namespace {

constexpr Duration kHeldAfter = std::chrono::seconds{1};

/// What noise may look like before the robot counts as standing, and what it takes to count as driving off.
constexpr double kStands_m = 0.005, kStands_rad = 0.05 * kRadPerDeg;
constexpr double kLeaves_m = 0.01, kLeaves_rad = 0.1 * kRadPerDeg;

} // namespace

std::optional<Pose> Standstill::observe(Stamp stamp, const Pose& T_odom_base, bool sources_saw_motion) {
  const Pose T_held_base = T_odom_held_.inverse() * T_odom_base;
  const bool near = T_held_base.translation.norm() < (standing_ ? kLeaves_m : kStands_m) &&
                    angle_rad(T_held_base.rotation) < (standing_ ? kLeaves_rad : kStands_rad);
  if (!begun_ || !near || sources_saw_motion) {
    begun_ = true;
    standing_ = false;
    since_ = stamp;
    T_odom_held_ = T_odom_base;
  }
  standing_ = standing_ || stamp - since_ >= kHeldAfter;
  return standing_ ? std::optional{T_odom_held_} : std::nullopt;
}

} // namespace locus
