// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "core/base/pose.hpp"
#include "core/base/source_id.hpp"
#include "core/base/stamp.hpp"

namespace locus {

inline constexpr double kGravity_mps2 = 9.80665; ///< standard gravity

/// Reading of an inertial measurement unit, in the sensor's own frame.
struct ImuSample {
  Stamp stamp;   ///< of the measurement
  Stamp arrival; ///< time of arrival at this computer
  Eigen::Vector3d angular_velocity_radps = Eigen::Vector3d::Zero();
  Eigen::Vector3d specific_force_mps2 = Eigen::Vector3d::Zero(); ///< +9.81 on z at rest and level
  std::optional<Eigen::Quaterniond>
      attitude; ///< R_world_imu, gravity-aligned world of arbitrary heading, if the unit provides one
};

/// Specific force during a sweep, in the base frame. The difference of two sweep-mean velocities is the specific force
/// weighted towards the end of the first sweep and the start of the second.
struct SpecificForce {
  Eigen::Vector3d early_base_mps2 = Eigen::Vector3d::Zero(); ///< mean, weighted by the time to the end of the sweep
  Eigen::Vector3d late_base_mps2 = Eigen::Vector3d::Zero(); ///< mean, weighted by the time since the start of the sweep
  Eigen::Vector3d noise_per_s = Eigen::Vector3d::Zero();    ///< variance that its integral gains per second
  SourceId source{};                                        ///< source that measured it
  Duration late{};                                          ///< stamp delay that has been removed

  [[nodiscard]] Eigen::Vector3d mean_base_mps2() const { return 0.5 * (early_base_mps2 + late_base_mps2); }
};

/// Pose from an odometry source (wheel, visual, kinematic).
struct OdometrySample {
  Stamp stamp;
  Stamp arrival;
  Pose T_source_base;            ///< pose of the base in the source's own odometry frame
  double covariance_scale = 1.0; ///< reported covariance relative to the usual one
};

} // namespace locus
