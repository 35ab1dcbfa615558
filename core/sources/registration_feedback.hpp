// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>

#include "core/base/pose.hpp"
#include "core/base/stamp.hpp"
#include "core/sources/sensed_motion.hpp"

namespace locus {

/// What lidar says about the motion that a source reported from one sweep to the next.
enum class LidarOpinion : std::uint8_t { none, agrees, disagrees };

/// Chi-square test of what a source is off by from one sweep to the next (metres and radians), over the axes that lidar
/// sees: those which it knows better than an honest source does.
LidarOpinion opinion_on(const Vector6& error, const Matrix6& lidar_information);

/// What a registered sweep tells the health monitors. Nothing else of the result goes back to the sensors' side, so
/// that a sweep never depends on when the one before it was registered, but for which sources are trusted.
struct RegistrationFeedback {
  Stamp from, to; ///< ends of the two sweeps between which it saw the motion
  std::array<LidarOpinion, kMaxSources> opinions{};
  Vector6 twist_base = Vector6::Zero(); ///< m/s and rad/s as lidar saw it; zero along axes that it hardly sees
  std::array<bool, 6> sees{};           ///< by axis
};

} // namespace locus
