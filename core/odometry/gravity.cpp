// SPDX-License-Identifier: Apache-2.0
#include "core/odometry/gravity.hpp"

#include <algorithm>
#include <cmath>

#include "core/sources/motion_sample.hpp"

namespace locus {

namespace {

constexpr double kTolerance_mps2 = 0.5;
constexpr double kSettles_s = 3.0; ///< longer than a robot accelerates continuously

constexpr double kMemoryOfTilt_sweeps = 200.0;
constexpr double kOutlier_rad = 5.0 * kRadPerDeg;      ///< an impact, not drift of the odometry
constexpr double kNotWorthIt_rad = 1.0 * kRadPerDeg;   ///< typical error of an accelerometer
constexpr double kPerKeyframe_rad = 0.02 * kRadPerDeg; ///< 3 mm in 10 m: less than the noise of the map

} // namespace

Eigen::Vector3d level_rpy_rad(const Eigen::Vector3d& up_base) {
  return {std::atan2(up_base.y(), up_base.z()), std::atan2(-up_base.x(), std::hypot(up_base.y(), up_base.z())), 0.0};
}

void Gravity::observe(const Eigen::Quaterniond& R_last_now, const Sweep& sweep) {
  if (up_base_)
    up_base_ = R_last_now.conjugate() * *up_base_;
  std::optional<Eigen::Vector3d> force;
  if (sweep.motion.specific_force)
    force = sweep.motion.specific_force->mean_base_mps2();
  measured_ = sweep.motion.up_base || (force && std::abs(force->norm() - kGravity_mps2) < kTolerance_mps2);
  if (!measured_)
    return;
  const Eigen::Vector3d measured = sweep.motion.up_base ? *sweep.motion.up_base : force->normalized();
  const double share = up_base_ ? std::min(1.0, to_seconds(sweep.end - sweep.start) / kSettles_s) : 1.0;
  const Eigen::Vector3d before = up_base_.value_or(measured);
  up_base_ = (before + share * (measured - before)).normalized();
}

void TiltKeeper::observe(const Eigen::Quaterniond& R_odom_base, const std::optional<Eigen::Vector3d>& up_base) {
  if (!up_base)
    return;
  const Eigen::Vector3d tilt_rad = (R_odom_base * *up_base).cross(Eigen::Vector3d::UnitZ());
  if (tilt_rad.norm() > kOutlier_rad)
    return;
  observed_ = std::min(observed_ + 1.0, kMemoryOfTilt_sweeps);
  tilt_rad_ += (tilt_rad - tilt_rad_) / observed_;
}

Eigen::Vector3d TiltKeeper::pop_correction_rad() {
  const double tilt_rad = tilt_rad_.norm();
  if (observed_ < kMemoryOfTilt_sweeps || tilt_rad < kNotWorthIt_rad)
    return Eigen::Vector3d::Zero();
  Eigen::Vector3d correction_rad = kPerKeyframe_rad / tilt_rad * tilt_rad_;
  tilt_rad_ -= correction_rad;
  return correction_rad;
}

} // namespace locus
