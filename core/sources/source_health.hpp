// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string_view>

#include "core/base/names.hpp"
#include "core/base/source_id.hpp"
#include "core/base/stamp.hpp"

namespace locus {

/// What can be wrong with a motion source.
enum class HealthReason : std::uint8_t {
  stale,        ///< silent for too long, or a sample that came too late
  jump,         ///< a motion that no robot can make
  nan,          ///< not a number, or one beyond all sense
  frozen,       ///< the same reading again, though the robot moves
  out_of_order, ///< a stamp that does not follow from the ones before
  covariance,   ///< much less certain than usual, as the source itself says
  disagreement, ///< it and lidar saw different motions: who is right is not known
  outside,      ///< somebody else says so
  self_check,   ///< ImuSelfCheck has refused it
  speed         ///< a speed that the robot is not able to, see MotionLimits
};
constexpr auto names_of(HealthReason) {
  return std::to_array<std::string_view>({"stale", "jump", "nan", "frozen", "out_of_order", "covariance",
                                          "disagreement", "outside", "self_check", "speed"});
}
inline constexpr std::size_t kHealthReasonCount = names_of(HealthReason{}).size();

/// Of a source that is lost for HealthReason::speed, in words for the user.
inline constexpr std::string_view kTooFast =
    "claims a higher speed than motion.max_speed_mps, and is not used while it does "
    "(set that to what the robot is able to, or look at the unit of the source)";

/// What became of the samples of one motion source.
struct SourceCounters {
  std::uint64_t received = 0; ///< samples
  /// Samples left out, by reason, and once each the silences and disagreements that cost the source its health.
  std::array<std::uint64_t, kHealthReasonCount> rejected{};
  std::uint64_t health_changes = 0; ///< lost and regained
  std::uint64_t clock_steps = 0;    ///< of the source's clock against the host's

  [[nodiscard]] std::uint64_t rejected_as(HealthReason reason) const {
    return rejected[static_cast<std::size_t>(reason)];
  }
};

/// A motion source has lost its health or regained it.
struct HealthEvent {
  SourceId source{};
  Stamp stamp; ///< when it was found out, in stamps of arrival
  bool healthy = false;
  HealthReason reason = HealthReason::stale; ///< why it was lost
  std::string_view verdict;                  ///< of HealthMonitor, where a self-check is the reason
};

} // namespace locus
