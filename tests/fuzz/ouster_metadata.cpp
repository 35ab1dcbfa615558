// SPDX-License-Identifier: Apache-2.0
// Metadata of an Ouster, and a decoder for the resulting sensor.
#include <cmath>

#include "drivers/ouster/decoder.hpp"
#include "drivers/ouster/imu_packet.hpp"
#include "fuzz/fuzz_bytes.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace locus;
  using fuzz::demand;
  const auto metadata = ouster::parse_metadata(fuzz::text_of(data, size));
  if (!metadata) {
    demand(!metadata.error().empty() && metadata.error().find('\n') == std::string::npos);
    return 0;
  }
  demand(metadata->T_sensor_lidar.finite() && metadata->T_sensor_imu.finite());
  demand(metadata->first_column < metadata->columns_per_frame && metadata->last_column < metadata->columns_per_frame);
  demand(metadata->columns_in_window() > 0 && metadata->columns_in_window() <= metadata->columns_per_frame);
  for (std::size_t i = 0; i < metadata->pixels_per_column; ++i)
    demand(std::isfinite(metadata->altitude_rad[i] + metadata->azimuth_rad[i]));
  demand(ouster::imu_packet_layout(*metadata).bytes > 0);
  const ouster::PacketFormat format = metadata->packet_format();
  std::vector<std::byte> payload(format.packet_bytes);
  payload[0] = std::byte{1};
  ouster::Decoder decoder{*metadata};
  LidarPacket packet;
  demand(decoder.decode(payload, packet) == PacketError::flag); // no column is valid
  return 0;
}
