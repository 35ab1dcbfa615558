// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "config/config.hpp"
#include "core/sweep.hpp"
#include "daemon/ingest.hpp"

namespace locus::daemon {

/// What the ingest has counted so far, as a copy that other threads may read. Plain memory.
struct IngestReport {
  struct Lidar {
    PacketCounters packets;
    std::optional<velodyne::Model> model;
    std::optional<velodyne::ReturnMode> return_mode;
    double rotation_rate_rpm = 0.0;
    std::optional<std::uint32_t> source_ip;  ///< host byte order
    std::optional<std::uint32_t> refused_ip; ///< LidarInput::refused_ip()
    Stamp last_heard;                        ///< LidarInput::last_heard()
    velodyne::PpsState pps = velodyne::PpsState::absent;
  };
  struct Source {
    SourceCounters counters;
    bool healthy = false;
    Stamp last_heard;         ///< HealthMonitor::last_heard()
    std::string_view verdict; ///< text that lives for ever; see HealthMonitor
  };

  PacketCounters total;
  std::array<Lidar, Config::kMaxLidars> lidars;   ///< by index
  std::array<Source, Sweep::kMaxSources> sources; ///< by index
  SweepBuilder::Counters sweeps;

  /// Called by the ingest thread.
  void read(const Ingest& ingest);
};

/// What the owner of a lidar should know of sweeps that are shorter than its turn; nothing where they are not.
std::optional<std::string> short_sweep(const SweepOptions& options, const std::string& lidar, double rotation_rate_rpm);

} // namespace locus::daemon
