// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <ctime>
#include <optional>
#include <string>

#include "core/base/pose.hpp"
#include "daemon/figures.hpp"
#include "daemon/incidents.hpp"
#include "daemon/machine_time.hpp"

namespace locus::daemon {

/// Notices by the figures of a service what is an incident: that it is dead reckoning for kLostFor after it has
/// tracked, because lidar is lost or registration fails; that a motion source is refused because lidar or gravity
/// contradict it. One owner.
class IncidentWatch {
 public:
  static constexpr Duration kLostFor = std::chrono::seconds{1}; ///< a sweep that fails alone is none
  static constexpr Duration kQuiet = std::chrono::seconds{10};  ///< after which a contradiction is another one

  using Clock = Duration (*)(clockid_t); ///< read_clock(), or another in tests
  explicit IncidentWatch(Clock clock = [](clockid_t id) { return read_clock(id); }) : clock_(clock) {}

  /// A few times a second. Each time it begins, once.
  std::optional<IncidentCause> look(const Figures& figures);

 private:
  Clock clock_;
  bool has_tracked_ = false;
  std::optional<Duration> lost_since_;   ///< CLOCK_MONOTONIC
  std::uint64_t contradictions_ = 0;     ///< counted so far
  std::optional<Duration> contradicted_; ///< last; CLOCK_MONOTONIC
};

/// For why.json: why, when, which program on which computer, and the status then.
std::string incident_report(IncidentCause cause, Stamp when, const Figures& figures);

/// Of a run that another process has left behind, which was last there as far as is known.
std::string restart_report(Stamp when, const std::filesystem::path& run, const std::optional<Pose>& T_odom_base);

} // namespace locus::daemon
