// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <utility>

#include "core/base/pose.hpp"
#include "core/base/source_id.hpp"
#include "core/sources/motion_sample.hpp"

namespace locus {

inline constexpr std::size_t kMaxSources = 8; ///< motion sources per robot, at most

/// Part of the robot's motion during a sweep that no motion source corrected.
enum class Uncorrected : std::uint8_t { nothing, translation, all };

/// Sources that determine the motion of the base; nothing where none is healthy.
struct SourceChoice {
  std::optional<SourceId> rotation;
  std::optional<SourceId> translation;

  [[nodiscard]] Uncorrected uncorrected() const {
    if (translation)
      return Uncorrected::nothing;
    return rotation ? Uncorrected::translation : Uncorrected::all;
  }
};

/// Pose of the base at the end of a sweep, measured by one motion source.
struct SourcePose {
  bool known = false;                   ///< there is a sample inside the sweep
  bool usable = false;                  ///< known, and the source is healthy and not too slow
  std::uint32_t epoch = 0;              ///< HealthMonitor::epoch; poses of different epochs are not comparable
  Pose T_source_base;                   ///< an inertial source gives rotation only
  Vector6 twist_base = Vector6::Zero(); ///< mean over the last kMoment of the sweep
  Duration late{};                      ///< stamp delay that has been removed

  static constexpr Duration kMoment = std::chrono::milliseconds{50};
};

/// Mean twist of the base between the ends of two sweeps, measured by one source (base axes).
struct SensedTwist {
  Vector6 mean = Vector6::Zero();
  Vector6 change_per_s = Vector6::Zero();    ///< rate of change from one end to the other
  Vector6 brought_forward = Vector6::Zero(); ///< part of the mean that is due to the removed stamp delay

  SensedTwist(Vector6 twist_base) : mean(std::move(twist_base)) {}
};

/// Measurements of all motion sources for a sweep.
struct SensedMotion {
  std::array<SourcePose, kMaxSources> sources; ///< by index in the configuration
  std::optional<SpecificForce> specific_force; ///< during the sweep, from the first usable inertial source
  std::optional<Eigen::Vector3d> up_base;      ///< unit vector, from the first healthy source with an attitude
};

} // namespace locus
