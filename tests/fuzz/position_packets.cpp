// SPDX-License-Identifier: Apache-2.0
// Position packets and their GPS sentence. Only the parts that are parsed are fuzzed: the time of hour, the state of
// the PPS and the sentence.
#include <array>
#include <cmath>

#include "drivers/velodyne/position_packet.hpp"
#include "fuzz/fuzz_bytes.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace locus;
  using fuzz::demand;
  static_cast<void>(velodyne::parse_nmea(fuzz::text_of(data, size)));

  std::array<std::byte, velodyne::kPositionPacketBytes> payload{};
  fuzz::FuzzBytes bytes{data, size};
  bytes.fill(std::span{payload}.subspan(velodyne::kTimeOfHourOffset));
  const velodyne::PositionPacket packet = velodyne::parse_position_packet(payload);
  demand(packet.pps <= velodyne::PpsState::error);
  if (!packet.rmc)
    return 0;
  demand(packet.rmc->time_of_day >= Duration{} &&
         packet.rmc->time_of_day < std::chrono::hours{24} + std::chrono::seconds{1});
  demand(!packet.rmc->date || packet.rmc->date->ok());
  demand(std::isfinite(packet.rmc->speed_mps.value_or(0.0)) && std::isfinite(packet.rmc->course_deg.value_or(0.0)));
  return 0;
}
