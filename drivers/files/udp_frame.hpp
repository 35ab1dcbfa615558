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

/// Reason why a captured frame yields no usable UDP datagram.
enum class FrameError : std::uint8_t {
  not_ip,    ///< ARP, LLDP, ...
  ipv6,      ///< not supported: Velodyne lidars use IPv4 only
  fragment,  ///< fragment of an IPv4 packet, for IpFragments
  not_udp,   ///< TCP, ICMP, ...
  malformed, ///< contradictory lengths or a truncated header
};

/// Returns true if udp_datagram() can parse frames of this libpcap link type (DLT_...).
bool link_type_supported(int link_type);

/// Parses the UDP datagram in a captured frame, or returns the reason why there is none; receive_stamp is not set,
/// since the frame does not contain it. `wire_bytes` is the length of the frame before truncation to the snap length.
/// Skips VLAN tags (any number) and IP options, strips padding, and ignores checksums, which are incomplete in captures
/// on the sending host. Pure, thread-safe. The payload points into `frame`.
Expected<Datagram, FrameError> udp_datagram(int link_type, std::span<const std::byte> frame, std::size_t wire_bytes);

/// Reassembles fragmented IPv4 packets that hold UDP datagrams, since an Ouster's column packets exceed an Ethernet
/// frame. Fragments may arrive in any order, and those of several packets interleaved; slots of incomplete packets are
/// reused. Single owner, not thread-safe. Allocates nothing after construction.
class IpFragments {
 public:
  IpFragments() : packets_(std::make_unique<std::array<Packet, kPackets>>()) {}

  /// Adds a frame in which udp_datagram() found a fragment. Returns the datagram that it completes, valid until the
  /// next call.
  std::optional<Datagram> add(int link_type, std::span<const std::byte> frame);

  /// Number of fragments joined to datagrams so far, excluding the one that completes each datagram.
  [[nodiscard]] std::uint64_t joined() const { return joined_; }

 private:
  static constexpr std::size_t kMaxPayload = 65'535, kUnit = 8; ///< unit of fragment offsets in bytes

  /// Key shared by all fragments of a packet.
  struct Name {
    std::uint32_t source_ip = 0, destination_ip = 0;
    std::uint16_t id = 0;
    bool operator==(const Name&) const = default;
  };
  struct Packet {
    Name name;
    std::uint64_t fragments = 0;                ///< number received; 0: free slot
    std::uint64_t latest = 0;                   ///< sequence number of the latest fragment, over all packets
    std::size_t bytes = 0;                      ///< received bytes
    std::optional<std::size_t> bytes_total;     ///< known once the last fragment is received
    std::bitset<kMaxPayload / kUnit + 1> units; ///< received units
    std::array<std::byte, kMaxPayload> payload; ///< after the IP header
  };
  static constexpr std::size_t kPackets = 8; ///< reassembled concurrently

  Packet& place_of(const Name& name);
  std::optional<Datagram> add(Packet& packet, std::span<const std::byte> fragment, std::size_t begin, bool is_last);

  std::unique_ptr<std::array<Packet, kPackets>> packets_;
  std::uint64_t added_ = 0, joined_ = 0;
};

} // namespace locus
