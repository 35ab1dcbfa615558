// SPDX-License-Identifier: Apache-2.0
#include "drivers/ouster/imu_packet.hpp"

#include <bit>

#include "drivers/ouster/checksum.hpp"
#include "drivers/wire.hpp"

namespace locus::ouster {

namespace {

constexpr double kStandardGravity_mps2 = 9.80665;

/// Layout after the header: time and text of the latest NMEA sentence, then the measurements.
constexpr std::size_t kNmeaBytes = 100, kMeasurementBytes = 36, kStatusAt = 10;

/// Legacy layout: times of the packet, of the accelerometer and of the gyro, then values in g and degrees per second.
constexpr ImuPacketLayout kLegacy{.bytes = 48,
                                  .first = 0,
                                  .stride = 48,
                                  .count = 1,
                                  .time = 16,
                                  .force = 24,
                                  .rate = 36,
                                  .force_unit_mps2 = kStandardGravity_mps2,
                                  .rate_unit_radps = kRadPerDeg};

Eigen::Vector3d read_vector(const std::byte* at) {
  const auto number = [&](std::size_t i) { return std::bit_cast<float>(read_u32(at + 4 * i)); };
  return Eigen::Vector3f{number(0), number(1), number(2)}.cast<double>();
}

std::optional<PacketError> problem_of_standard(const Metadata& metadata, std::span<const std::byte> payload) {
  const PacketHeader header = read_header(payload, metadata.safety_header);
  if (header.packet_type != PacketHeader::kImu)
    return PacketError::flag;
  if (header.serial_number != 0 && metadata.serial_number != 0 && header.serial_number != metadata.serial_number)
    return PacketError::sender;
  const bool has_checksum = !metadata.safety_header;
  return !has_checksum || has_right_checksum(payload) ? std::nullopt : std::optional{PacketError::checksum};
}

constexpr std::size_t kFirstMeasurementAt = PacketFormat::kPacketHeaderBytes + kNmeaBytes;

} // namespace

bool is_standard_imu_packet(std::span<const std::byte> payload) {
  constexpr std::size_t kFrame = kFirstMeasurementAt + PacketFormat::kPacketFooterBytes;
  if (payload.size() <= kFrame || (payload.size() - kFrame) % kMeasurementBytes != 0 ||
      (payload.size() - kFrame) / kMeasurementBytes > ImuMeasurements::kMost)
    return false;
  const auto is_imu = [&](bool is_safety_header) {
    const PacketHeader header = read_header(payload, is_safety_header);
    return header.packet_type == PacketHeader::kImu && header.serial_number != 0;
  };
  return is_imu(false) || is_imu(true);
}

ImuPacketLayout imu_packet_layout(const Metadata& metadata) {
  if (!metadata.standard_imu_packets)
    return kLegacy;
  const std::size_t count = metadata.imu_measurements_per_packet;
  return {.bytes = kFirstMeasurementAt + count * kMeasurementBytes + PacketFormat::kPacketFooterBytes,
          .first = kFirstMeasurementAt,
          .stride = kMeasurementBytes,
          .count = count,
          .time = 0,
          .force = 12,
          .rate = 24,
          .force_unit_mps2 = 1.0,
          .rate_unit_radps = 1.0};
}

std::optional<PacketError> read_imu_packet(const Metadata& metadata, std::span<const std::byte> payload,
                                           ImuMeasurements& out) {
  out.count = 0;
  const ImuPacketLayout layout = imu_packet_layout(metadata);
  if (payload.size() != layout.bytes)
    return PacketError::length;
  if (metadata.standard_imu_packets) {
    if (const auto error = problem_of_standard(metadata, payload))
      return error;
  }
  const std::byte* at = payload.data() + layout.first;
  for (std::size_t i = 0; i < layout.count; ++i, at += layout.stride) {
    if (metadata.standard_imu_packets && (read_u16(at + kStatusAt) & 1U) == 0)
      continue; // marked invalid by the sensor
    const std::uint64_t time_ns = read_u64(at + layout.time);
    if (time_ns > static_cast<std::uint64_t>(to_ns(kLatestStamp)))
      return PacketError::time;
    const Eigen::Vector3d rate_radps = layout.rate_unit_radps * read_vector(at + layout.rate);
    const Eigen::Vector3d force_mps2 = layout.force_unit_mps2 * read_vector(at + layout.force);
    if (rate_radps.allFinite() && force_mps2.allFinite())
      out.storage[out.count++] = {Duration{static_cast<Duration::rep>(time_ns)}, rate_radps, force_mps2};
  }
  return out.count == 0 ? std::optional{PacketError::flag} : std::nullopt;
}

} // namespace locus::ouster
