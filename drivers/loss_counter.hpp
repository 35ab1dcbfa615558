// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>

#include "core/base/stamp.hpp"
#include "core/ingest/lidar_packet.hpp"
#include "drivers/packet_counters.hpp"
#include "drivers/packet_decoder.hpp"
#include "drivers/sensor_clock.hpp"
#include "drivers/sent_sectors.hpp"

namespace locus {

/// Counts lost and reordered packets of one lidar.
///
/// - Loss: gaps in the packet numbers. Without numbers, gaps in the stamps, confirmed by the azimuth for gaps of up to
///   one second; a sector that is never sent is no loss.
/// - Reordering: a packet that precedes the latest one; it is no longer lost.
///
/// Single owner, not thread-safe. Allocates nothing.
class LossCounter {
 public:
  /// Adds the packet that `decoder` has just decoded, with its reading of the sensor's clock. Updates the counters
  /// `lost` and `reordered`.
  void add(const LidarPacket& packet, const PacketDecoder& decoder, const SensorClock::Reading& reading,
           PacketCounters& counters);

 private:
  void count_lost(const LidarPacket& packet, const PacketDecoder& decoder, Duration advance, PacketCounters& counters);
  [[nodiscard]] std::uint64_t missing_by_time(const LidarPacket& packet, const PacketDecoder& decoder,
                                              Duration advance) const;

  std::uint16_t last_azimuth_cdeg_ = 0; ///< first firing of the latest packet
  std::uint32_t last_number_ = 0;       ///< number of the latest packet; 0 if it has none
  Duration last_duration_{};            ///< duration of the latest packet
  SentSectors sectors_;                 ///< only for packets without numbers
};

} // namespace locus
