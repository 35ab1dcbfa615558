// SPDX-License-Identifier: Apache-2.0
// Packets of an Ouster: arbitrary bytes, and well-formed packets with some bytes changed.
#include <array>
#include <chrono>
#include <cmath>
#include <vector>

#include "drivers/ouster/decoder.hpp"
#include "drivers/ouster/imu_packet.hpp"
#include "drivers/ouster_test_packet.hpp"
#include "fuzz/fuzz_bytes.hpp"

namespace locus {
namespace {

using fuzz::demand;

/// Bits of a packet's first byte.
enum Step : std::uint8_t { kAnyBytes = 1, kOtherLength = 2, kUnsealed = 4, kImu = 8, kLater = 16 };

std::vector<ouster::Metadata> all_kinds() {
  std::vector<ouster::Metadata> kinds;
  for (std::size_t profile = 0; profile < ouster::kProfiles; ++profile) {
    kinds.push_back(test::ouster_metadata(static_cast<ouster::Profile>(profile), profile % 2 == 0 ? 16 : 32));
    kinds.back().standard_imu_packets = profile > 3;
    kinds.back().imu_measurements_per_packet = profile > 3 ? 8 : 1;
    kinds.back().first_column = 1020 * (profile % 2);
    kinds.back().safety_header = profile % 4 == 3;
  }
  return kinds;
}

void check(const ouster::Metadata& metadata, const LidarPacket& packet) {
  constexpr Duration kLongest = std::chrono::seconds{1};
  demand(packet.count > 0 && packet.count <= LidarPacket::kMaxFiringGroups && packet.first_azimuth_cdeg < 36000);
  demand(packet.duration > Duration{} && packet.duration < kLongest);
  for (const FiringGroup& group : packet.firing_groups()) {
    demand(group.first_laser + FiringGroup::kLasers <= metadata.pixels_per_column);
    for (std::size_t k = 0; k < FiringGroup::kLasers; ++k) {
      demand(std::isfinite(group.x_m[k] + group.y_m[k] + group.z_m[k]) && group.range_m[k] >= 0.0F);
      demand(group.ring[k] < metadata.pixels_per_column);
      demand(group.offset_ns[k] >= 0 && Duration{group.offset_ns[k]} < packet.duration);
    }
  }
}

/// Changes a few bytes, each given by offset and new value.
void change(fuzz::FuzzBytes& bytes, std::span<std::byte> payload) {
  for (std::uint8_t changes = bytes.take<std::uint8_t>() % 8; changes > 0; --changes) {
    const auto at = bytes.take<std::uint16_t>();
    payload[at % payload.size()] = static_cast<std::byte>(bytes.take<std::uint8_t>());
  }
}

std::vector<std::byte> lidar_packet(fuzz::FuzzBytes& bytes, const ouster::Metadata& metadata, std::uint8_t step,
                                    std::size_t column, std::uint64_t time_ns) {
  test::OusterTestPacket packet{metadata, column, time_ns, static_cast<std::uint32_t>(column / 1024)};
  std::vector<std::byte> payload{packet.payload().begin(), packet.payload().end()};
  if ((step & kAnyBytes) != 0)
    bytes.fill(payload);
  change(bytes, payload);
  if ((step & kUnsealed) == 0)
    test::put_little_endian(&payload[payload.size() - 8], ouster::crc64(std::span{payload}.first(payload.size() - 8)),
                            8);
  if ((step & kOtherLength) != 0)
    payload.resize(bytes.take<std::uint16_t>());
  return payload;
}

void read_imu(fuzz::FuzzBytes& bytes, const ouster::Metadata& metadata, std::uint8_t step) {
  std::vector<std::byte> payload(ouster::imu_packet_layout(metadata).bytes);
  bytes.fill(payload);
  if ((step & kUnsealed) == 0)
    test::put_little_endian(&payload[payload.size() - 8], ouster::crc64(std::span{payload}.first(payload.size() - 8)),
                            8);
  if ((step & kOtherLength) != 0)
    payload.resize(bytes.take<std::uint8_t>());
  ouster::ImuMeasurements measurements;
  if (ouster::read_imu_packet(metadata, payload, measurements))
    return;
  demand(measurements.count > 0 && measurements.count <= metadata.imu_measurements_per_packet);
  for (const ouster::ImuMeasurement& one : measurements.all()) {
    demand(one.time >= Duration{} && one.angular_velocity_radps.allFinite() && one.specific_force_mps2.allFinite());
  }
}

} // namespace
} // namespace locus

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace locus;
  static const std::vector<ouster::Metadata> kKinds = all_kinds();
  fuzz::FuzzBytes bytes{data, size};
  const ouster::Metadata& metadata = kKinds[bytes.take<std::uint8_t>() % kKinds.size()];
  ouster::Decoder decoder{metadata};
  LidarPacket packet;
  constexpr int kLongestStream = 16;
  std::size_t column = 0;
  std::uint64_t time_ns = 1'000'000'000;
  for (int packets = 0; packets < kLongestStream && !bytes.empty(); ++packets) {
    const auto step = bytes.take<std::uint8_t>();
    if ((step & kLater) != 0) {
      const auto columns = bytes.take<std::uint16_t>();
      column += columns;
      time_ns += columns * std::uint64_t{test::OusterTestPacket::kColumnNs};
    }
    if ((step & kImu) != 0)
      read_imu(bytes, metadata, step);
    else if (!decoder.decode(lidar_packet(bytes, metadata, step, column, time_ns), packet))
      check(metadata, packet);
  }
  return 0;
}
