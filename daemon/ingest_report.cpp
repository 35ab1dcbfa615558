// SPDX-License-Identifier: Apache-2.0
#include "daemon/ingest_report.hpp"

#include <fmt/format.h>

namespace locus::daemon {

void IngestReport::read(const Ingest& ingest) {
  total = ingest.lidars().total();
  for (std::size_t i = 0; i < ingest.lidars().lidars().size(); ++i) {
    const LidarInput& lidar = ingest.lidars().lidars()[i];
    const velodyne::Decoder& decoder = lidar.decoder();
    lidars[i] = {.packets = lidar.counters(),
                 .model = decoder.model(),
                 .return_mode = decoder.return_mode(),
                 .rotation_rate_rpm = decoder.model() ? decoder.rotation_rate_rpm() : 0.0,
                 .source_ip = lidar.source_ip(),
                 .refused_ip = lidar.refused_ip(),
                 .last_heard = lidar.last_heard(),
                 .pps = lidar.position() ? lidar.position()->pps : velodyne::PpsState::absent};
  }
  for (std::size_t i = 0; i < ingest.sources().size(); ++i)
    sources[i] = {.counters = ingest.sources().counters(i),
                  .healthy = ingest.sources().healthy(i),
                  .last_heard = ingest.sources().last_heard(i),
                  .verdict = ingest.sources().verdict(i)};
  sweeps = ingest.sweeps().counters();
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
