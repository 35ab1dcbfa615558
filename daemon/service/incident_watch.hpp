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

/// Detects incidents from the figures of a service: dead reckoning for kMinLoss after tracking, through loss of lidar
/// or failed registration; rejection of a motion source because lidar or gravity contradicts it. One owner.
class IncidentWatch {
 public:
  static constexpr Duration kMinLoss = std::chrono::seconds{1}; ///< a single failed sweep is no incident
  static constexpr Duration kMinGap = std::chrono::seconds{10}; ///< quiet time that separates two contradictions

  using Clock = Duration (*)(clockid_t); ///< read_clock(), replaceable in tests
  explicit IncidentWatch(Clock clock = [](clockid_t id) { return read_clock(id); }) : clock_(clock) {}

  /// Checks the figures, a few times a second. Returns the cause once per incident, at its start.
  std::optional<IncidentCause> check(const Figures& figures);

 private:
  Clock clock_;
  bool has_tracked_ = false;
  std::optional<Duration> lost_since_;   ///< CLOCK_MONOTONIC
  std::uint64_t contradictions_ = 0;     ///< count at the last check
  std::optional<Duration> contradicted_; ///< time of the last one; CLOCK_MONOTONIC
};

/// Returns the contents of why.json: cause, time, program version, host and the status at that time.
std::string incident_report(IncidentCause cause, Stamp when, const Figures& figures);

/// Returns the contents of why.json for a run that another process left behind; `T_odom_base` is its last known pose.
std::string restart_report(Stamp when, const std::filesystem::path& run, const std::optional<Pose>& T_odom_base);

} // namespace locus::daemon
