// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/base/expected.hpp"
#include "core/base/stamp.hpp"
#include "drivers/net/datagram.hpp"

struct pcap;
struct pcap_dumper;

namespace locus {

using Bytes = std::vector<std::byte>;

void append(Bytes& bytes, std::span<const std::byte> more);

/// Appends the lowest `count` bytes of `value`, most significant first, as on the network.
void append_big_endian(Bytes& bytes, std::uint64_t value, int count);

/// Addresses of a UDP datagram, host byte order.
struct UdpAddresses {
  std::uint32_t source_ip = 0xC0A801C9; // 192.168.1.201, a Velodyne's default
  std::uint16_t source_port = 2368;
  std::uint32_t destination_ip = 0xFFFFFFFF;
  std::uint16_t destination_port = 2368;
};

/// Wraps a UDP payload in an IPv4 packet without checksums. The length of `ip_options` must be a multiple of four
/// bytes.
Bytes ipv4_udp(const UdpAddresses& addresses, std::span<const std::byte> payload,
               std::span<const std::byte> ip_options = {});

/// Wraps a packet in an Ethernet frame; `tags` are inserted between the addresses and the EtherType, for example a VLAN
/// tag of four bytes.
Bytes ethernet(std::span<const std::byte> packet, std::uint16_t ether_type = 0x0800,
               std::span<const std::byte> tags = {});

/// Writes capture files: pcap with nanosecond stamps. The file is complete after destruction. Single owner, not
/// thread-safe.
class PcapWriter {
 public:
  static constexpr int kEthernet = 1; ///< link type
  static constexpr std::size_t kHeaderBytes = 24;

  /// Opens a file for writing; "-" is standard output. Overwrites an existing file. Fails with one line for the user.
  static Expected<PcapWriter, std::string> open(const std::filesystem::path& file, int link_type = kEthernet);

  /// Writes a UDP datagram in IPv4 in Ethernet; requires link type kEthernet. Errors of this and the next two functions
  /// are reported by flush().
  void write(Stamp stamp, const UdpAddresses& addresses, std::span<const std::byte> payload);

  /// Writes a datagram with the broadcast address as its destination.
  void write(const Datagram& datagram);

  /// Writes any bytes as one captured frame, truncated to `snap_length`.
  void write_frame(Stamp stamp, std::span<const std::byte> frame, std::size_t snap_length = 65535);

  /// Flushes to the operating system. Returns one line for the user if any write so far has failed.
  std::optional<std::string> flush();

  /// Size of the file so far.
  [[nodiscard]] std::uint64_t bytes() const { return bytes_; }
  [[nodiscard]] int descriptor() const;

 private:
  struct Closer {
    void operator()(pcap* handle) const;
    void operator()(pcap_dumper* file) const;
  };

  PcapWriter(std::filesystem::path file, pcap* handle) : file_(std::move(file)), pcap_(handle) {}
  [[nodiscard]] std::string cannot_be_written() const;

  std::filesystem::path file_;
  std::unique_ptr<pcap, Closer> pcap_;
  std::unique_ptr<pcap_dumper, Closer> dumper_;
  std::uint64_t bytes_ = kHeaderBytes;
};

} // namespace locus
