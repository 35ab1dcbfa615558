// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "core/base/pose.hpp"
#include "core/base/stamp.hpp"
#include "core/sources/sensed_motion.hpp"

namespace locus {

/// Verdict of lidar on the motion that a source measured from one sweep to the next.
enum class LidarOpinion : std::uint8_t { none, agrees, disagrees };

/// Difference between the motion measured by one source and by all others.
struct Innovation {
  Vector6 value = Vector6::Zero();    ///< m/s and rad/s, source minus others; base axes
  Vector6 variance = Vector6::Zero(); ///< expected; zero along axes that the source does not measure
  Vector6 others = Vector6::Zero();   ///< part of the variance that is due to the others
  Vector6 known = Vector6::Zero();    ///< part of the variance of a healthy source in such a motion
};

inline constexpr double kInnovationGate = 38.0; ///< exceeded once in a million by six correct axes

/// Returns the normalised innovation squared divided by the gate, over the axes that the others determine better than a
/// healthy source does; nothing if there are none. Above one the source is contradicted.
std::optional<double> test_ratio(const Innovation& innovation, double elapsed_s);
LidarOpinion opinion_on(const Innovation& innovation, double elapsed_s);

/// Feedback of a registered sweep to the health monitors. Nothing else of the result returns to the sensors' side, so a
/// sweep does not depend on when the previous one was registered, except through the choice of trusted sources and
/// their estimated stamp delays.
struct RegistrationFeedback {
  Stamp from, to; ///< ends of the two sweeps between which lidar measured the motion
  std::array<LidarOpinion, kMaxSources> opinions{};
  Vector6 twist_base = Vector6::Zero();     ///< m/s and rad/s, measured by lidar; zero along weakly observed axes
  std::array<bool, 6> observes{};           ///< observed axes
  std::array<Duration, kMaxSources> late{}; ///< delay of each source's stamps after the motion
};

} // namespace locus
