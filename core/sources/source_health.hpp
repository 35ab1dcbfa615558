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

/// Reasons why a sample is rejected or a motion source loses its health.
enum class HealthReason : std::uint8_t {
  stale,        ///< silent for too long, or a sample that arrived too late
  jump,         ///< a motion that is physically impossible
  nan,          ///< not a number, or an implausibly large one
  frozen,       ///< a repeated reading although the robot moves
  out_of_order, ///< a stamp that is not consistent with the previous ones
  covariance,   ///< reported covariance much larger than usual
  disagreement, ///< motion differs from lidar's; either may be wrong
  outside,      ///< rejected by an external monitor
  self_check,   ///< rejected by ImuSelfCheck
  speed,        ///< a speed beyond MotionLimits
  no_rotation   ///< an orientation whose quaternion is not of unit length
};
constexpr auto names_of(HealthReason) {
  return std::to_array<std::string_view>({"stale", "jump", "nan", "frozen", "out_of_order", "covariance",
                                          "disagreement", "outside", "self_check", "speed", "no_rotation"});
}
inline constexpr std::size_t kHealthReasonCount = names_of(HealthReason{}).size();

/// Verdict on a source that is lost for HealthReason::speed, for the user.
inline constexpr std::string_view kTooFast =
    "claims a higher speed than motion.max_speed_mps, and is not used while it does "
    "(set that to what the robot is able to, or look at the unit of the source)";

/// Says for the user why samples are refused or a source is lost, and what to do about it; follows the name of the
/// source.
std::string_view explanation(HealthReason reason);

/// Run of samples of a source that are refused or, on probation, not used; between them it was never healthy.
struct Refusal {
  static constexpr Duration kWorthReporting = std::chrono::seconds{5};

  HealthReason reason = HealthReason::stale; ///< of the latest refused sample, or of the loss before the probation
  Duration lasted{};                         ///< from the first to the latest such sample

  /// Returns false for a self-check, which has a verdict of its own.
  [[nodiscard]] bool is_worth_reporting() const {
    return lasted > kWorthReporting && reason != HealthReason::self_check;
  }
};

/// Counters of the samples of one motion source.
struct SourceCounters {
  std::uint64_t received = 0; ///< samples
  /// Rejected samples by reason; a silence or a disagreement that costs the source its health counts once.
  std::array<std::uint64_t, kHealthReasonCount> rejected{};
  std::uint64_t health_changes = 0; ///< losses and recoveries
  std::uint64_t clock_steps = 0;    ///< of the source's clock relative to the host's

  [[nodiscard]] std::uint64_t rejected_as(HealthReason reason) const {
    return rejected[static_cast<std::size_t>(reason)];
  }
};

/// Loss or recovery of a motion source's health.
struct HealthEvent {
  SourceId source{};
  Stamp stamp; ///< time of detection, in stamps of arrival
  bool healthy = false;
  HealthReason reason = HealthReason::stale; ///< of the loss
  std::string_view verdict;                  ///< of HealthMonitor, if the reason is a self-check
};

} // namespace locus
