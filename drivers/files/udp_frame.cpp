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
  return ether_type == 0x8100 || ether_type == 0x88A8 || ether_type == 0x9100; // 802.1Q, 802.1ad, pre-standard QinQ
}

/// Returns the IP packet after a link header of `header_bytes` with an EtherType at `type_at`.
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

/// Returns the IP packet after a BSD loopback header: an address family in the byte order of the capturing computer,
/// with an OS-specific number for IPv6.
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

constexpr std::size_t kMinIpHeaderBytes = 20;
constexpr std::uint8_t kUdp = 17;
constexpr std::uint16_t kMoreFragments = 0x2000, kFragmentOffset = 0x1FFF;

/// Parses the UDP datagram after an IP header that gives `ip_payload_bytes` for it. `cut_bytes` of it were on the wire
/// but not captured.
Expected<Datagram, FrameError> datagram_in_udp(ByteSpan udp, std::size_t ip_payload_bytes, std::size_t cut_bytes,
                                               std::uint32_t source_ip) {
  constexpr std::size_t kUdpHeaderBytes = 8;
  if (udp.size() < kUdpHeaderBytes) {
    return FrameError::malformed;
  }
  const std::size_t udp_bytes = big_endian_16(udp, 4);
  // A VLP-16 of 2014 puts the IP length of its data packets into its position packets, so that length alone is
  // unreliable.
  if (udp_bytes < kUdpHeaderBytes || udp_bytes > std::min(ip_payload_bytes, udp.size() + cut_bytes)) {
    return FrameError::malformed;
  }
  const std::size_t kept_bytes = std::min(udp_bytes, udp.size());
  Datagram datagram;
  datagram.payload = udp.subspan(kUdpHeaderBytes, kept_bytes - kUdpHeaderBytes);
  datagram.source_ip = source_ip;
  datagram.source_port = big_endian_16(udp, 0);
  datagram.destination_port = big_endian_16(udp, 2);
  datagram.truncated = kept_bytes < udp_bytes;
  return datagram;
}

/// Parses an IP packet. `cut_bytes` of it were on the wire but not captured.
Expected<Datagram, FrameError> datagram_in(ByteSpan packet, std::size_t cut_bytes) {
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
  if ((big_endian_16(packet, 6) & (kMoreFragments | kFragmentOffset)) != 0) {
    return FrameError::fragment;
  }
  if (byte_at(packet, 9) != kUdp) {
    return FrameError::not_udp;
  }
  if (packet.size() < ip_header_bytes) {
    return FrameError::malformed;
  }
  return datagram_in_udp(packet.subspan(ip_header_bytes), ip_bytes - ip_header_bytes, cut_bytes,
                         big_endian_32(packet, 12));
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

std::optional<Datagram> IpFragments::add(int link_type, std::span<const std::byte> frame) {
  const Expected<ByteSpan, FrameError> found = ip_packet(link_type, frame);
  if (!found) {
    return std::nullopt;
  }
  const ByteSpan packet = *found;
  if (const auto whole = datagram_in(packet, 0); whole || whole.error() != FrameError::fragment) {
    return std::nullopt;
  }
  const std::size_t header_bytes = (byte_at(packet, 0) & 0xFu) * std::size_t{4};
  const std::size_t bytes = big_endian_16(packet, 2) - header_bytes;
  const std::uint16_t flags = big_endian_16(packet, 6);
  const std::size_t begin = (flags & kFragmentOffset) * kUnit;
  const bool is_last = (flags & kMoreFragments) == 0;
  const bool fits = byte_at(packet, 9) == kUdp && bytes > 0 && packet.size() >= header_bytes + bytes &&
                    begin + bytes <= kMaxPayload && (is_last || bytes % kUnit == 0);
  if (!fits) {
    return std::nullopt;
  }
  const Name name{big_endian_32(packet, 12), big_endian_32(packet, 16), big_endian_16(packet, 4)};
  return add(place_of(name), packet.subspan(header_bytes, bytes), begin, is_last);
}

/// Returns the slot of this packet; if there is none, resets a free slot or the one that has waited longest.
IpFragments::Packet& IpFragments::place_of(const Name& name) {
  for (Packet& packet : *packets_) {
    if (packet.fragments > 0 && packet.name == name) {
      return packet;
    }
  }
  Packet& place = *std::ranges::min_element(
      *packets_, {}, [](const Packet& packet) { return packet.fragments > 0 ? packet.latest : std::uint64_t{0}; });
  place.name = name;
  place.fragments = 0;
  return place;
}

/// Adds a fragment. A part received before belongs to a later packet with the same identification, so the slot
/// restarts.
std::optional<Datagram> IpFragments::add(Packet& packet, ByteSpan fragment, std::size_t begin, bool is_last) {
  const std::size_t first = begin / kUnit, behind = (begin + fragment.size() + kUnit - 1) / kUnit;
  bool is_new = packet.fragments == 0;
  for (std::size_t unit = first; unit < behind && !is_new; ++unit) {
    is_new = packet.units[unit];
  }
  if (is_new) {
    packet.fragments = packet.bytes = 0;
    packet.bytes_total.reset();
    packet.units.reset();
  }
  for (std::size_t unit = first; unit < behind; ++unit) {
    packet.units.set(unit);
  }
  std::ranges::copy(fragment, packet.payload.begin() + static_cast<std::ptrdiff_t>(begin));
  packet.bytes += fragment.size();
  packet.latest = ++added_;
  ++packet.fragments;
  if (is_last) {
    packet.bytes_total = begin + fragment.size();
  }
  if (packet.bytes != packet.bytes_total) {
    return std::nullopt;
  }
  const auto datagram =
      datagram_in_udp(ByteSpan{packet.payload}.first(packet.bytes), packet.bytes, 0, packet.name.source_ip);
  joined_ += datagram ? packet.fragments - 1 : 0;
  packet.fragments = 0;
  return datagram ? std::optional{*datagram} : std::nullopt;
}

} // namespace locus
