// SPDX-License-Identifier: Apache-2.0
#include "drivers/loss_counter.hpp"

#include <algorithm>
#include <cmath>

namespace locus {

void LossCounter::add(const LidarPacket& packet, const PacketDecoder& decoder, const SensorClock::Reading& reading,
                      PacketCounters& counters) {
  if (reading.continuous && reading.advance <= Duration{}) {
    ++counters.reordered;
    counters.lost -= std::min<std::uint64_t>(counters.lost, 1);
    return;
  }
  if (reading.continuous)
    count_lost(packet, decoder, reading.advance, counters);
  last_azimuth_cdeg_ = packet.first_azimuth_cdeg;
  last_number_ = decoder.number().value_or(0);
  last_duration_ = packet.duration;
}

void LossCounter::count_lost(const LidarPacket& packet, const PacketDecoder& decoder, Duration advance,
                             PacketCounters& counters) {
  if (decoder.number()) {
    counters.lost += decoder.packets_since(last_number_, advance);
    return;
  }
  const std::uint64_t missing = missing_by_time(packet, decoder, advance);
  const double cdeg_per_s = decoder.rotation_rate_rpm() / 60.0 * velodyne::kCdegPerTurn;
  const double turned_cdeg = cdeg_per_s * to_seconds(advance);
  const bool within_a_turn = missing > 0 && turned_cdeg < velodyne::kCdegPerTurn;
  const double end_of_last_cdeg = last_azimuth_cdeg_ + cdeg_per_s * to_seconds(last_duration_);
  counters.lost +=
      within_a_turn ? sectors_.lost_between(end_of_last_cdeg, packet.first_azimuth_cdeg, missing) : missing;
  const bool skips_a_sector = 2 * packet.duration > 3 * decoder.nominal_duration();
  sectors_.add(packet.first_azimuth_cdeg, skips_a_sector ? 0.0 : decoder.turn_of_packet_cdeg(), turned_cdeg);
  counters.lost -= std::min(counters.lost, sectors_.withdraw_false_losses()); // maybe also this gap
}

/// Returns the number of packets missing between the latest one and this one. The tolerance covers the motor's speed
/// change over a gap and the azimuth resolution of 0.01 degrees: the VLS-128 turns by 0.4 degrees or less between the
/// first and the last column of a packet.
std::uint64_t LossCounter::missing_by_time(const LidarPacket& packet, const PacketDecoder& decoder,
                                           Duration advance) const {
  constexpr Duration kLongestGapByAzimuth = std::chrono::seconds{1};
  constexpr double kRoundingCdeg = 1.5, kAzimuthToleranceCdeg = 100.0;
  constexpr double kSpeedTolerance = 0.02; // relative change of the motor's speed over a gap
  const Duration nominal = decoder.nominal_duration();
  const double rounding = kRoundingCdeg / std::max(decoder.turn_of_packet_cdeg(), kRoundingCdeg);
  const Duration skipped = std::max(last_duration_ - nominal, Duration{}); // known as well as the speed
  const auto missing =
      std::llround((to_seconds(advance - last_duration_) - rounding * to_seconds(skipped)) / to_seconds(nominal));
  if (missing <= 0)
    return 0;
  if (advance <= kLongestGapByAzimuth) {
    const double expected_cdeg = decoder.rotation_rate_rpm() / 60.0 * velodyne::kCdegPerTurn * to_seconds(advance);
    const double turned_cdeg = packet.first_azimuth_cdeg - last_azimuth_cdeg_;
    const double error_cdeg = std::remainder(turned_cdeg - expected_cdeg, velodyne::kCdegPerTurn);
    if (std::abs(error_cdeg) > kAzimuthToleranceCdeg + std::max(kSpeedTolerance, rounding) * expected_cdeg)
      return 0;
  }
  return static_cast<std::uint64_t>(missing);
}

} // namespace locus
