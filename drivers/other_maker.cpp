// SPDX-License-Identifier: Apache-2.0
#include "drivers/other_maker.hpp"

#include <algorithm>
#include <initializer_list>

#include "drivers/hesai/model.hpp"
#include "drivers/ouster/imu_packet.hpp"
#include "drivers/ouster/metadata.hpp"
#include "drivers/wire.hpp"

namespace locus {

namespace {

using Packet = std::span<const std::byte>;

bool begins_with(Packet packet, std::initializer_list<unsigned> bytes) {
  return packet.size() > bytes.size() && std::equal(bytes.begin(), bytes.end(), packet.begin(),
                                                    [](unsigned a, std::byte b) { return std::byte(a) == b; });
}

/// Recognises column packets of 16 columns by their length.
bool is_ouster_length(std::size_t bytes) {
  constexpr std::size_t kColumns = 16;
  for (std::size_t profile = 0; profile < ouster::kProfiles; ++profile)
    for (const std::size_t pixels : {16U, 32U, 64U, 128U})
      if (bytes == ouster::PacketFormat{static_cast<ouster::Profile>(profile), false, pixels, kColumns}.packet_bytes)
        return true;
  return false;
}

/// Protocol of the Livox SDK 2 (HAP, Mid-360): a header of 36 bytes with version 0, the length of the packet and the
/// number of points.
bool is_livox_2(Packet packet) {
  constexpr std::size_t kHeader = 36, kImu = 24;
  constexpr std::array<std::size_t, 4> kPointBytes{0, 14, 8, 10}; ///< by data type; 0: inertial unit
  if (packet.size() <= kHeader || packet[0] != std::byte{0} || read_u16(&packet[1]) != packet.size())
    return false;
  const auto type = std::to_integer<std::size_t>(packet[10]);
  if (type == 0)
    return packet.size() == kHeader + kImu;
  return type < kPointBytes.size() && packet.size() == kHeader + read_u16(&packet[5]) * kPointBytes[type];
}

/// Protocol of the first Livox SDK (Mid-40, Horizon, Avia and others): a header of 18 bytes with version 5, and a fixed
/// length for each data type.
bool is_livox_1(Packet packet) {
  constexpr std::array<std::size_t, 9> kBytes{1318, 918, 1362, 978, 1362, 786, 42, 1278, 678};
  if (packet.size() < 18 || packet[0] != std::byte{5})
    return false;
  const auto type = std::to_integer<std::size_t>(packet[9]);
  return type < kBytes.size() && packet.size() == kBytes[type];
}

bool is_robosense(Packet packet) {
  return begins_with(packet, {0x55, 0xAA, 0x05, 0x0A, 0x5A, 0xA5, 0x50, 0xA0}) || // RS-16, RS-32, Bpearl
         begins_with(packet, {0x55, 0xAA, 0x05, 0x5A}) ||                         // Helios, Ruby, Airy
         begins_with(packet, {0x55, 0xAA, 0x5A, 0xA5}) ||                         // M and E series
         begins_with(packet, {0xA5, 0xFF, 0x00, 0x5A});                           // DIFOP
}

bool is_seyond(Packet packet) {
  constexpr std::size_t kLengthAt = 10;
  return (begins_with(packet, {0x6A, 0x17}) || begins_with(packet, {0x6B, 0x18})) && packet.size() >= kLengthAt + 4 &&
         read_u32(&packet[kLengthAt]) == packet.size();
}

} // namespace

std::optional<OtherMaker> unsupported_maker(std::span<const std::byte> payload) {
  if (is_livox_2(payload) || is_livox_1(payload))
    return OtherMaker::livox;
  if (is_robosense(payload))
    return OtherMaker::robosense;
  return is_seyond(payload) ? std::optional{OtherMaker::seyond} : std::nullopt;
}

bool is_ouster_imu(const Datagram& datagram) {
  const Packet payload = datagram.payload;
  return (payload.size() == ouster::imu_packet_layout({}).bytes &&
          datagram.destination_port == ouster::kDefaultImuPort) ||
         ouster::is_standard_imu_packet(payload);
}

std::optional<OtherMaker> other_maker(const Datagram& datagram) {
  const Packet payload = datagram.payload;
  if (const auto looks = hesai::look_at(payload))
    return looks->model ? std::nullopt : std::optional{OtherMaker::hesai};
  if (const auto maker = unsupported_maker(payload))
    return maker;
  const std::uint16_t port = datagram.destination_port;
  if (port == ouster::kDefaultLidarPort || port == ouster::kDefaultImuPort || is_ouster_length(payload.size()) ||
      is_ouster_imu(datagram))
    return OtherMaker::ouster;
  return std::nullopt;
}

} // namespace locus
