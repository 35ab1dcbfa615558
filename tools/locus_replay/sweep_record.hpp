// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>

#include "core/ingest/sweep.hpp"
#include "core/odometry/odometry_estimate.hpp"
#include "daemon/sweep_processor.hpp"

namespace locus::tools {

/// Contribution of a lidar or a motion source to a sweep.
enum class SourceHealth : std::uint8_t {
  lost,    ///< no data, or none to be trusted
  healthy, ///< usable, but not used
  used
};

/// Data of one sweep for the report: a couple of hundred bytes.
struct SweepRecord {
  Stamp stamp;
  Pose T_odom_base;
  double std_m = 0; ///< of the position, as estimated
  double speed_mps = 0;
  double wall_ms = 0;
  daemon::StageTimes stages_took{};
  TrackingState state = TrackingState::tracking;
  SourceHealth lidars = SourceHealth::used; ///< healthy: the registration was rejected
  std::array<SourceHealth, kMaxSources> sources{};
};

SweepRecord record_of(const daemon::ProcessedSweep& sweep);

} // namespace locus::tools
