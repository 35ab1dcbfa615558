// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "core/base/pose.hpp"
#include "core/base/stamp.hpp"
#include "core/sources/sensed_motion.hpp"

namespace locus {

/// What lidar says about the motion that a source reported from one sweep to the next.
enum class LidarOpinion : std::uint8_t { none, agrees, disagrees };

/// What a motion source says and what all others say, compared.
struct Innovation {
  Vector6 value = Vector6::Zero();    ///< m/s and rad/s, the source's less that of the others; base axes
  Vector6 variance = Vector6::Zero(); ///< that it should have; zero along axes of which the source says nothing
  Vector6 others = Vector6::Zero();   ///< the part of it that is not the source's
  Vector6 known = Vector6::Zero();    ///< the part that an honest source of its kind has while it moves like that
};

inline constexpr double kInnovationGate = 38.0; ///< exceeded once in a million by six honest axes

/// Normalised innovation squared in units of the gate, over the axes that are known without the source better than an
/// honest source knows them; nothing where there are none. Above one the source is contradicted.
std::optional<double> test_ratio(const Innovation& innovation, double elapsed_s);
LidarOpinion opinion_on(const Innovation& innovation, double elapsed_s);

/// What a registered sweep tells the health monitors. Nothing else of the result goes back to the sensors' side, so
/// that a sweep never depends on when the one before it was registered, but for which sources are trusted and how late
/// their stamps are known to be.
struct RegistrationFeedback {
  Stamp from, to; ///< ends of the two sweeps between which it saw the motion
  std::array<LidarOpinion, kMaxSources> opinions{};
  Vector6 twist_base = Vector6::Zero();     ///< m/s and rad/s as lidar saw it; zero along axes that it hardly sees
  std::array<bool, 6> sees{};               ///< by axis
  std::array<Duration, kMaxSources> late{}; ///< by how much each source stamps its samples after the motion
};

} // namespace locus
