// SPDX-License-Identifier: Apache-2.0
#include "daemon/ingest_report.hpp"

#include <vector>

#include <fmt/format.h>

#include "drivers/net/ip_address.hpp"

namespace locus::daemon {

namespace {

/// One packet in so many makes no lidar.
constexpr std::uint64_t kNextToNothing = 100;

} // namespace

IngestReport::Lidar IngestReport::Lidar::of(const LidarInput& lidar) {
  const velodyne::Decoder& decoder = lidar.decoder();
  return {.packets = lidar.counters(),
          .model = decoder.model(),
          .return_mode = decoder.return_mode(),
          .rotation_rate_rpm = decoder.model() ? decoder.rotation_rate_rpm() : 0.0,
          .source_ip = lidar.source_ip(),
          .refused_ip = lidar.refused_ip(),
          .strangers = lidar.strangers(),
          .unknown_packets = decoder.unknown_packets(),
          .last_heard = lidar.last_heard(),
          .pps = lidar.position() ? lidar.position()->pps : velodyne::PpsState::absent};
}

void IngestReport::read(const Ingest& ingest) {
  total = ingest.lidars().total();
  for (std::size_t i = 0; i < ingest.lidars().lidars().size(); ++i) {
    lidars[i] = Lidar::of(ingest.lidars().lidars()[i]);
  }
  for (std::size_t i = 0; i < ingest.sources().size(); ++i) {
    const HealthMonitor& health = ingest.sources().health(SourceId{i});
    sources[i] = {.counters = health.counters(),
                  .healthy = health.healthy(),
                  .last_heard = health.last_heard(),
                  .verdict = health.verdict()};
  }
  sweeps = ingest.sweeps().counters();
}

std::optional<std::string> shared_port(const LidarOptions& options, const IngestReport::Lidar& lidar) {
  if (options.source_ip || !lidar.source_ip)
    return std::nullopt;
  std::vector<std::string> refused;
  std::string yaml =
      fmt::format("{{name: {}, port: {}, source_ip: {}}}", options.name, options.port, dotted(*lidar.source_ip));
  for (const LidarInput::Stranger& stranger : lidar.strangers) {
    if (stranger.ip == *lidar.source_ip || stranger.packets * kNextToNothing <= lidar.packets.data)
      continue;
    refused.push_back(fmt::format("{} of {}", stranger.packets, dotted(stranger.ip)));
    yaml += fmt::format(", {{name: {}_{}, port: {}, source_ip: {}}}", options.name, refused.size() + 1, options.port,
                        dotted(stranger.ip));
  }
  if (refused.empty())
    return std::nullopt;
  return fmt::format("lidar {}: others send to its port {}, too: the packets of {} are read, and {} are refused; if "
                     "these are lidars, give each its own entry, with its T_base_lidar: lidars: [{}]",
                     options.name, options.port, dotted(*lidar.source_ip), fmt::join(refused, ", "), yaml);
}

std::optional<std::string> unknown_model(const LidarOptions& options, const IngestReport::Lidar& lidar) {
  if (!lidar.unknown_packets || lidar.unknown_packets->packets * kNextToNothing <= lidar.packets.data)
    return std::nullopt;
  return fmt::format("lidar {0}: refused {1}, no model that can be read; if another device sends to port {2}, set "
                     "lidars.{0}.source_ip to that of the lidar",
                     options.name, velodyne::to_string(*lidar.unknown_packets), options.port);
}

std::optional<std::string> short_sweep(const SweepOptions& options, const std::string& lidar,
                                       double rotation_rate_rpm) {
  constexpr double kAlmost = 0.95, kMsPerMinute = 60e3;
  if (!options.sweep_period || rotation_rate_rpm <= 0.0)
    return std::nullopt;
  const double turn_ms = kMsPerMinute / rotation_rate_rpm, sweep_ms = 1e3 * to_seconds(*options.sweep_period);
  if (sweep_ms >= kAlmost * turn_ms)
    return std::nullopt;
  return fmt::format(
      "lidar {}: turns in {:.0f} ms, so a sweep of {:.0f} ms sees a part of what is around, each another "
      "one; set sweep_period_ms: auto",
      lidar, turn_ms, sweep_ms);
}

} // namespace locus::daemon
