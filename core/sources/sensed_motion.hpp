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

inline constexpr std::size_t kMaxSources = 8; ///< motion sources of a robot, at most

/// The part of the robot's motion during a sweep that no motion source could take out of its points.
enum class Uncorrected : std::uint8_t { nothing, translation, all };

/// Which sources stand for the motion of the base; nothing where none is healthy.
struct SourceChoice {
  std::optional<SourceId> rotation;
  std::optional<SourceId> translation;

  [[nodiscard]] Uncorrected uncorrected() const {
    if (translation)
      return Uncorrected::nothing;
    return rotation ? Uncorrected::translation : Uncorrected::all;
  }
};

/// Where one motion source saw the base at the end of a sweep.
struct SourcePose {
  bool known = false;      ///< with a sample inside the sweep
  bool usable = false;     ///< known, and healthy
  std::uint32_t epoch = 0; ///< HealthMonitor::epoch; poses of different epochs have nothing to do with each other
  Pose T_source_base;      ///< an inertial source gives rotation only
  Vector6 twist_base = Vector6::Zero(); ///< in the last kMoment of the sweep
  Duration late{};                      ///< taken out of its stamps

  static constexpr Duration kMoment = std::chrono::milliseconds{50};
};

/// The mean twist of the base from the end of one sweep to that of another, as a source has it (base axes).
struct SensedTwist {
  Vector6 mean = Vector6::Zero();
  Vector6 change_per_s = Vector6::Zero();    ///< from one end to the other
  Vector6 brought_forward = Vector6::Zero(); ///< the part of the mean that is due to what was taken out of the stamps

  SensedTwist(Vector6 twist_base) : mean(std::move(twist_base)) {}
};

/// What all motion sources say of a sweep.
struct SensedMotion {
  std::array<SourcePose, kMaxSources> sources; ///< by index in the configuration
  std::optional<SpecificForce> specific_force; ///< during the sweep, from the first usable inertial source
  std::optional<Eigen::Vector3d> up_base;      ///< unit vector, from that source's attitude where it has one
};

} // namespace locus
