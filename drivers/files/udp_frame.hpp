// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "core/base/expected.hpp"
#include "drivers/net/datagram.hpp"

namespace locus {

/// Why a captured frame holds no UDP datagram that can be used.
enum class FrameError : std::uint8_t {
  not_ip,    ///< ARP, LLDP, ...
  ipv6,      ///< Velodyne lidars speak IPv4 only
  fragment,  ///< part of an IPv4 packet; fragments are not put together
  not_udp,   ///< TCP, ICMP, ...
  malformed, ///< a header lies about lengths, or is cut short
};

/// Whether udp_datagram() can take frames of this libpcap link type (DLT_...) apart.
bool link_type_supported(int link_type);

/// The UDP datagram in a frame as captured, or why there is none; without receive_stamp, which the frame does not know.
/// `wire_bytes` is the length that the frame had before the snap length cut it. VLAN tags (any number) and IP options
/// are skipped, padding is left out, checksums are not looked at: a capture on the sending host has unfinished ones.
/// Pure, any thread. The payload is part of `frame`.
Expected<Datagram, FrameError> udp_datagram(int link_type, std::span<const std::byte> frame, std::size_t wire_bytes);

} // namespace locus
