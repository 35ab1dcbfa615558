// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cerrno>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <span>
#include <stdexcept>
#include <string>
#include <system_error>
#include <vector>

#include <pcap/pcap.h>

#include "core/stamp.hpp"
#include "drivers/datagram.hpp"

namespace locus::sim {

using Bytes = std::vector<std::byte>;

inline void append(Bytes& bytes, std::span<const std::byte> more) {
  bytes.insert(bytes.end(), more.begin(), more.end());
}

/// Appends the lowest `count` bytes of `value`, most significant first, as on the network.
inline void append_big_endian(Bytes& bytes, std::uint64_t value, int count) {
  for (int shift = 8 * (count - 1); shift >= 0; shift -= 8) {
    bytes.push_back(static_cast<std::byte>(value >> shift & 0xFFu));
  }
}

/// Addresses of a UDP datagram, host byte order.
struct UdpAddresses {
  std::uint32_t source_ip = 0xC0A801C9; // 192.168.1.201, a Velodyne's default
  std::uint16_t source_port = 2368;
  std::uint32_t destination_ip = 0xFFFFFFFF;
  std::uint16_t destination_port = 2368;
};

/// IPv4 packet around a UDP datagram, without checksums. `ip_options` must be a multiple of four bytes.
inline Bytes ipv4_udp(const UdpAddresses& addresses, std::span<const std::byte> payload,
                      std::span<const std::byte> ip_options = {}) {
  const std::size_t header_bytes = 20 + ip_options.size();
  const std::size_t udp_bytes = 8 + payload.size();
  Bytes packet;
  packet.reserve(header_bytes + udp_bytes);
  append_big_endian(packet, 0x40 | header_bytes / 4, 1); // version, header length in words
  append_big_endian(packet, 0, 1);                       // type of service
  append_big_endian(packet, header_bytes + udp_bytes, 2);
  append_big_endian(packet, 0, 2);      // identification
  append_big_endian(packet, 0x4000, 2); // do not fragment
  append_big_endian(packet, 64, 1);     // time to live
  append_big_endian(packet, 17, 1);     // UDP
  append_big_endian(packet, 0, 2);      // checksum
  append_big_endian(packet, addresses.source_ip, 4);
  append_big_endian(packet, addresses.destination_ip, 4);
  append(packet, ip_options);
  append_big_endian(packet, addresses.source_port, 2);
  append_big_endian(packet, addresses.destination_port, 2);
  append_big_endian(packet, udp_bytes, 2);
  append_big_endian(packet, 0, 2); // checksum
  append(packet, payload);
  return packet;
}

/// Ethernet frame around a packet; `tags` is whatever stands between the addresses and the EtherType, for example a
/// VLAN tag of four bytes.
inline Bytes ethernet(std::span<const std::byte> packet, std::uint16_t ether_type = 0x0800,
                      std::span<const std::byte> tags = {}) {
  Bytes frame;
  append_big_endian(frame, 0xFFFFFFFFFFFF, 6);
  append_big_endian(frame, 0x607688201234, 6);
  append(frame, tags);
  append_big_endian(frame, ether_type, 2);
  append(frame, packet);
  return frame;
}

/// Writes capture files: nanosecond pcap, Ethernet unless another link type is asked for; "-" is standard output. The
/// file is complete once the writer is gone. Throws std::runtime_error when it cannot write.
class PcapWriter {
 public:
  explicit PcapWriter(const std::filesystem::path& path, int link_type = DLT_EN10MB)
      : pcap_(pcap_open_dead_with_tstamp_precision(link_type, 65535, PCAP_TSTAMP_PRECISION_NANO)),
        dumper_(pcap_dump_open(pcap_.get(), path.c_str())), path_(path.string()) {
    if (!dumper_)
      throw cannot_be_written();
  }

  /// A UDP datagram in IPv4 in Ethernet; only for a writer of that link type.
  void write(Stamp stamp, std::uint32_t source_ip, std::uint16_t source_port, std::uint32_t destination_ip,
             std::uint16_t destination_port, std::span<const std::byte> payload) {
    write_frame(stamp, ethernet(ipv4_udp({source_ip, source_port, destination_ip, destination_port}, payload)));
  }

  /// As it was sent: to everyone.
  void write(const Datagram& datagram) {
    write(datagram.receive_stamp, datagram.source_ip, datagram.source_port, UdpAddresses{}.destination_ip,
          datagram.destination_port, datagram.payload);
  }

  /// Throws unless everything has reached the file.
  void flush() {
    if (pcap_dump_flush(dumper_.get()) != 0 || std::ferror(pcap_dump_file(dumper_.get())) != 0)
      throw cannot_be_written();
  }

  /// Any bytes as one captured frame, of which only the first `snap_length` are kept.
  void write_frame(Stamp stamp, std::span<const std::byte> frame, std::size_t snap_length = 65535) {
    pcap_pkthdr header{};
    header.ts.tv_sec = to_ns(stamp) / 1'000'000'000;
    header.ts.tv_usec = to_ns(stamp) % 1'000'000'000; // nanoseconds, by the precision of this file
    header.len = static_cast<bpf_u_int32>(frame.size());
    header.caplen = static_cast<bpf_u_int32>(std::min(frame.size(), snap_length));
    const std::span<const std::byte> kept = frame.first(header.caplen);
    pcap_dump(reinterpret_cast<u_char*>(dumper_.get()), &header, reinterpret_cast<const u_char*>(kept.data()));
  }

 private:
  [[nodiscard]] std::runtime_error cannot_be_written() const {
    return std::runtime_error(path_ + ": cannot be written (" + std::generic_category().message(errno) +
                              "); check permissions and free space");
  }

  struct Closer {
    void operator()(pcap_t* handle) const { pcap_close(handle); }
    void operator()(pcap_dumper_t* file) const { pcap_dump_close(file); }
  };
  std::unique_ptr<pcap_t, Closer> pcap_;
  std::unique_ptr<pcap_dumper_t, Closer> dumper_;
  std::string path_;
};

} // namespace locus::sim
