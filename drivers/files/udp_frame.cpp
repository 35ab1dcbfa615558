// SPDX-License-Identifier: Apache-2.0
#include "drivers/files/udp_frame.hpp"

#include <algorithm>

#include <pcap/dlt.h>

namespace locus {
namespace {

using ByteSpan = std::span<const std::byte>;

std::uint8_t byte_at(ByteSpan bytes, std::size_t at) { return std::to_integer<std::uint8_t>(bytes[at]); }

std::uint16_t big_endian_16(ByteSpan bytes, std::size_t at) {
  return static_cast<std::uint16_t>(byte_at(bytes, at) << 8 | byte_at(bytes, at + 1));
}

std::uint32_t big_endian_32(ByteSpan bytes, std::size_t at) {
  return std::uint32_t{big_endian_16(bytes, at)} << 16 | big_endian_16(bytes, at + 2);
}

bool is_vlan_tag(std::uint16_t ether_type) {
  return ether_type == 0x8100 || ether_type == 0x88A8 ||
         ether_type == 0x9100; // 802.1Q, 802.1ad, QinQ before the standard
}

/// The IP packet behind a link header of `header_bytes` with an EtherType at `type_at`.
Expected<ByteSpan, FrameError> behind_ether_type(ByteSpan frame, std::size_t header_bytes, std::size_t type_at) {
  constexpr std::size_t kVlanTagBytes = 4;
  if (frame.size() < header_bytes) {
    return FrameError::malformed;
  }
  std::uint16_t ether_type = big_endian_16(frame, type_at);
  ByteSpan rest = frame.subspan(header_bytes);
  while (is_vlan_tag(ether_type)) {
    if (rest.size() < kVlanTagBytes) {
      return FrameError::malformed;
    }
    ether_type = big_endian_16(rest, 2);
    rest = rest.subspan(kVlanTagBytes);
  }
  switch (ether_type) {
  case 0x0800:
    return rest;
  case 0x86DD:
    return FrameError::ipv6;
  default:
    return FrameError::not_ip;
  }
}

/// The IP packet behind a BSD loopback header: an address family in the byte order of the capturing computer, and for
/// IPv6 a different number on every system.
Expected<ByteSpan, FrameError> behind_loopback(ByteSpan frame) {
  constexpr std::size_t kHeaderBytes = 4;
  if (frame.size() < kHeaderBytes) {
    return FrameError::malformed;
  }
  switch (std::max(byte_at(frame, 0), byte_at(frame, 3))) {
  case 2:
    return frame.subspan(kHeaderBytes);
  case 10: // Linux
  case 24: // NetBSD, OpenBSD
  case 28: // FreeBSD
  case 30: // macOS
    return FrameError::ipv6;
  default:
    return FrameError::not_ip;
  }
}

Expected<ByteSpan, FrameError> ip_packet(int link_type, ByteSpan frame) {
  switch (link_type) {
  case DLT_EN10MB:
    return behind_ether_type(frame, 14, 12);
  case DLT_LINUX_SLL:
    return behind_ether_type(frame, 16, 14);
  case DLT_LINUX_SLL2:
    return behind_ether_type(frame, 20, 0);
  case DLT_NULL:
  case DLT_LOOP:
    return behind_loopback(frame);
  case DLT_RAW:
  case DLT_IPV4:
    return frame;
  default:
    return FrameError::not_ip;
  }
}

/// `cut_bytes` of the packet were on the wire, but not captured.
Expected<Datagram, FrameError> datagram_in(ByteSpan packet, std::size_t cut_bytes) {
  constexpr std::size_t kMinIpHeaderBytes = 20;
  constexpr std::size_t kUdpHeaderBytes = 8;
  constexpr std::uint8_t kUdp = 17;
  constexpr std::uint16_t kMoreFragmentsOrOffset = 0x3FFF;

  if (!packet.empty() && byte_at(packet, 0) >> 4 == 6) {
    return FrameError::ipv6;
  }
  if (packet.size() < kMinIpHeaderBytes || byte_at(packet, 0) >> 4 != 4) {
    return FrameError::malformed;
  }
  const std::size_t ip_header_bytes = (byte_at(packet, 0) & 0xFu) * std::size_t{4};
  const std::size_t ip_bytes = big_endian_16(packet, 2);
  if (ip_header_bytes < kMinIpHeaderBytes || ip_bytes < ip_header_bytes) {
    return FrameError::malformed;
  }
  if ((big_endian_16(packet, 6) & kMoreFragmentsOrOffset) != 0) {
    return FrameError::fragment;
  }
  if (byte_at(packet, 9) != kUdp) {
    return FrameError::not_udp;
  }
  if (packet.size() < ip_header_bytes + kUdpHeaderBytes) {
    return FrameError::malformed;
  }
  const ByteSpan udp = packet.subspan(ip_header_bytes);
  const std::size_t udp_bytes = big_endian_16(udp, 4);
  // The IP length alone may claim too much: a VLP-16 of 2014 puts that of its data packets in its position packets.
  if (udp_bytes < kUdpHeaderBytes || udp_bytes > std::min(ip_bytes - ip_header_bytes, udp.size() + cut_bytes)) {
    return FrameError::malformed;
  }
  const std::size_t kept_bytes = std::min(udp_bytes, udp.size());
  Datagram datagram;
  datagram.payload = udp.subspan(kUdpHeaderBytes, kept_bytes - kUdpHeaderBytes);
  datagram.source_ip = big_endian_32(packet, 12);
  datagram.source_port = big_endian_16(udp, 0);
  datagram.destination_port = big_endian_16(udp, 2);
  datagram.truncated = kept_bytes < udp_bytes;
  return datagram;
}

} // namespace

bool link_type_supported(int link_type) {
  switch (link_type) {
  case DLT_EN10MB:
  case DLT_LINUX_SLL:
  case DLT_LINUX_SLL2:
  case DLT_NULL:
  case DLT_LOOP:
  case DLT_RAW:
  case DLT_IPV4:
    return true;
  default:
    return false;
  }
}

Expected<Datagram, FrameError> udp_datagram(int link_type, std::span<const std::byte> frame, std::size_t wire_bytes) {
  const Expected<ByteSpan, FrameError> packet = ip_packet(link_type, frame);
  if (!packet) {
    return packet.error();
  }
  return datagram_in(*packet, wire_bytes - std::min(wire_bytes, frame.size()));
}

} // namespace locus
