// SPDX-License-Identifier: Apache-2.0
#include "drivers/velodyne/packet_edit.hpp"

#include <chrono>
#include <limits>

#include "drivers/field_of_view.hpp"
#include "drivers/longer_range.hpp"
#include "drivers/velodyne/model.hpp"
#include "drivers/velodyne/position_packet.hpp"
#include "drivers/wire.hpp"

namespace locus::velodyne {

namespace {

/// Returns the position of a packet's microseconds past the hour; nullptr for other packets.
std::byte* clock_in(std::span<std::byte> packet) {
  if (packet.size() == kDataPacketBytes)
    return packet.data() + kTimeOffset;
  return packet.size() == kPositionPacketBytes ? packet.data() + kTimeOfHourOffset : nullptr;
}

} // namespace

void shift_clock(std::span<std::byte> packet, Duration shift) {
  using std::chrono::microseconds;
  constexpr microseconds kHour = std::chrono::hours{1};
  std::byte* const clock = clock_in(packet);
  if (clock == nullptr || microseconds{read_u32(clock)} >= kHour)
    return;
  const microseconds shifted = microseconds{read_u32(clock)} + std::chrono::duration_cast<microseconds>(shift);
  put_little_endian(clock, static_cast<std::uint64_t>(((shifted % kHour + kHour) % kHour).count()), 4);
}

void lengthen_ranges(std::span<std::byte> packet, double more_m) {
  if (packet.size() != kDataPacketBytes)
    return;
  const auto model = model_from_product_id(std::to_integer<std::uint8_t>(packet[kProductIdOffset]));
  if (!model)
    return;
  const double more = more_m / spec(*model).calibration.distance_resolution_m;
  for (std::size_t i = 0; i < kBlocks * kChannels; ++i) {
    std::byte* const range =
        packet.data() + i / kChannels * kBlockBytes + kBlockHeaderBytes + i % kChannels * kChannelBytes;
    constexpr std::uint32_t kLongest = std::numeric_limits<std::uint16_t>::max();
    put_little_endian(range, longer_range(read_u16(range), more, kLongest), 2);
  }
}

void narrow_view(std::span<std::byte> packet, double view_deg) {
  if (packet.size() != kDataPacketBytes)
    return;
  for (std::size_t block = 0; block < kBlocks; ++block) {
    std::byte* const at = packet.data() + block * kBlockBytes;
    if (is_in_view(0.01 * read_u16(at + 2), view_deg))
      continue;
    for (std::size_t channel = 0; channel < kChannels; ++channel)
      put_little_endian(at + kBlockHeaderBytes + channel * kChannelBytes, 0, 2);
  }
}

} // namespace locus::velodyne
