// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "config/config.hpp"
#include "core/ingest/sweep.hpp"
#include "daemon/ingest.hpp"

namespace locus::daemon {

/// What the ingest has counted so far, as a copy that other threads may read. Plain memory.
struct IngestReport {
  struct Lidar {
    PacketCounters packets;
    std::optional<velodyne::Model> model;
    std::optional<velodyne::ReturnMode> return_mode;
    double rotation_rate_rpm = 0.0;
    std::optional<std::uint32_t> source_ip;                  ///< host byte order
    std::optional<std::uint32_t> refused_ip;                 ///< LidarInput::refused_ip()
    LidarInput::Strangers strangers;                         ///< LidarInput::strangers()
    std::optional<velodyne::UnknownPackets> unknown_packets; ///< velodyne::Decoder::unknown_packets()
    Stamp last_heard;                                        ///< LidarInput::last_heard()
    velodyne::PpsState pps = velodyne::PpsState::absent;

    static Lidar of(const LidarInput& lidar);
  };
  struct Source {
    SourceCounters counters;
    bool healthy = false;
    Stamp last_heard;         ///< HealthMonitor::last_heard()
    std::string_view verdict; ///< text that lives for ever; see HealthMonitor
  };

  PacketCounters total;
  std::array<Lidar, Config::kMaxLidars> lidars; ///< by index
  std::array<Source, kMaxSources> sources;      ///< by index
  SweepBuilder::Counters sweeps;

  /// Called by the ingest thread.
  void read(const Ingest& ingest);
};

/// That somebody else, who may be a second lidar, sends to the port of a lidar whose address is not configured: who,
/// and the configuration that tells them apart. Nothing while next to nothing is refused for it.
std::optional<std::string> shared_port(const LidarOptions& options, const IngestReport::Lidar& lidar);

/// That packets of a model which cannot be read come to a lidar's port, and what they say of themselves. Nothing while
/// there are next to none.
std::optional<std::string> unknown_model(const LidarOptions& options, const IngestReport::Lidar& lidar);

/// What the owner of a lidar should know of sweeps that are shorter than its turn; nothing where they are not.
std::optional<std::string> short_sweep(const SweepOptions& options, const std::string& lidar, double rotation_rate_rpm);

} // namespace locus::daemon
