// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "core/base/pose.hpp"
#include "core/base/source_id.hpp"
#include "core/base/stamp.hpp"

namespace locus {

inline constexpr double kGravity_mps2 = 9.80665; ///< standard gravity

/// One reading of an inertial measurement unit, in the sensor's own frame.
struct ImuSample {
  Stamp stamp;   ///< of the measurement
  Stamp arrival; ///< when it reached this computer
  Eigen::Vector3d angular_velocity_radps = Eigen::Vector3d::Zero();
  Eigen::Vector3d specific_force_mps2 = Eigen::Vector3d::Zero(); ///< +9.81 on z at rest and level
  std::optional<Eigen::Quaterniond>
      attitude; ///< R_world_imu, gravity-aligned world of arbitrary heading, where the unit has one
};

/// Specific force during a sweep, in the base frame: what the velocity changes by between the means of two sweeps is
/// what is felt in the later part of the first and in the earlier part of the second.
struct SpecificForce {
  Eigen::Vector3d early_base_mps2 = Eigen::Vector3d::Zero(); ///< mean, each sample by its share of the time to the end
  Eigen::Vector3d late_base_mps2 = Eigen::Vector3d::Zero();  ///< mean, each sample by its share of the time since start
  Eigen::Vector3d noise_per_s = Eigen::Vector3d::Zero();     ///< variance that its integral gains in a second
  SourceId source{};                                         ///< that feels it
  Duration late{};                                           ///< taken out of its stamps

  [[nodiscard]] Eigen::Vector3d mean_base_mps2() const { return 0.5 * (early_base_mps2 + late_base_mps2); }
};

/// One pose of an odometry source (wheel, visual, kinematic).
struct OdometrySample {
  Stamp stamp;
  Stamp arrival;
  Pose T_source_base;            ///< pose of the base in the source's own odometry frame
  double covariance_scale = 1.0; ///< how much worse than usual the source says it is
};

} // namespace locus
