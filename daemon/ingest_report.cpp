// SPDX-License-Identifier: Apache-2.0
#include "daemon/ingest_report.hpp"

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

} // namespace locus::daemon
