// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <bitset>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>

#include "core/base/expected.hpp"
#include "drivers/net/datagram.hpp"

namespace locus {

/// Why a captured frame holds no UDP datagram that can be used.
enum class FrameError : std::uint8_t {
  not_ip,    ///< ARP, LLDP, ...
  ipv6,      ///< Velodyne lidars speak IPv4 only
  fragment,  ///< part of an IPv4 packet, for IpFragments
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

/// Puts the fragments of IPv4 packets together that hold UDP datagrams: those of an Ouster's columns are longer than an
/// Ethernet frame. They may come in any order, and those of several packets in turns; of a packet that is never
/// complete the memory is used again. One owner. Allocates nothing after construction.
class IpFragments {
 public:
  IpFragments() : packets_(std::make_unique<std::array<Packet, kPackets>>()) {}

  /// Takes a frame in which udp_datagram() found a fragment; the datagram that it completes, valid until the next call.
  std::optional<Datagram> take(int link_type, std::span<const std::byte> frame);

  /// Fragments that another one has completed to a datagram so far.
  [[nodiscard]] std::uint64_t joined() const { return joined_; }

 private:
  static constexpr std::size_t kMaxPayload = 65'535, kUnit = 8; ///< fragments begin at multiples of that

  /// What all fragments of a packet say alike.
  struct Name {
    std::uint32_t source_ip = 0, destination_ip = 0;
    std::uint16_t id = 0;
    bool operator==(const Name&) const = default;
  };
  struct Packet {
    Name name;
    std::uint64_t fragments = 0;                ///< that are there; 0: the place is free
    std::uint64_t latest = 0;                   ///< of them, counted over all packets
    std::size_t bytes = 0;                      ///< that are there
    std::optional<std::size_t> bytes_total;     ///< known with the last fragment
    std::bitset<kMaxPayload / kUnit + 1> units; ///< that are there
    std::array<std::byte, kMaxPayload> payload; ///< behind the IP header
  };
  static constexpr std::size_t kPackets = 8; ///< at once

  Packet& place_of(const Name& name);
  std::optional<Datagram> add(Packet& packet, std::span<const std::byte> fragment, std::size_t begin, bool is_last);

  std::unique_ptr<std::array<Packet, kPackets>> packets_;
  std::uint64_t taken_ = 0, joined_ = 0;
};

} // namespace locus
