// SPDX-License-Identifier: Apache-2.0
#include "drivers/files/pcap_writer.hpp"

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <system_error>
#include <utility>

#include <fmt/format.h>
#include <pcap/pcap.h>

namespace locus {
namespace {

constexpr std::size_t kRecordHeaderBytes = 16;
constexpr int kSnapLength = 65535;

} // namespace

void append(Bytes& bytes, std::span<const std::byte> more) { bytes.insert(bytes.end(), more.begin(), more.end()); }

void append_big_endian(Bytes& bytes, std::uint64_t value, int count) {
  for (int shift = 8 * (count - 1); shift >= 0; shift -= 8) {
    bytes.push_back(static_cast<std::byte>(value >> shift & 0xFFu));
  }
}

Bytes ipv4_udp(const UdpAddresses& addresses, std::span<const std::byte> payload,
               std::span<const std::byte> ip_options) {
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

Bytes ethernet(std::span<const std::byte> packet, std::uint16_t ether_type, std::span<const std::byte> tags) {
  Bytes frame;
  append_big_endian(frame, 0xFFFFFFFFFFFF, 6);
  append_big_endian(frame, 0x607688201234, 6);
  append(frame, tags);
  append_big_endian(frame, ether_type, 2);
  append(frame, packet);
  return frame;
}

void PcapWriter::Closer::operator()(pcap* handle) const { pcap_close(handle); }
void PcapWriter::Closer::operator()(pcap_dumper* file) const { pcap_dump_close(file); }

Expected<PcapWriter, std::string> PcapWriter::open(const std::filesystem::path& file, int link_type) {
  static_assert(kEthernet == DLT_EN10MB);
  PcapWriter writer(file, pcap_open_dead_with_tstamp_precision(link_type, kSnapLength, PCAP_TSTAMP_PRECISION_NANO));
  writer.dumper_.reset(pcap_dump_open(writer.pcap_.get(), file.c_str()));
  if (!writer.dumper_)
    return writer.cannot_be_written();
  return writer;
}

void PcapWriter::write(Stamp stamp, const UdpAddresses& addresses, std::span<const std::byte> payload) {
  write_frame(stamp, ethernet(ipv4_udp(addresses, payload)));
}

void PcapWriter::write(const Datagram& datagram) {
  UdpAddresses addresses;
  addresses.source_ip = datagram.source_ip;
  addresses.source_port = datagram.source_port;
  addresses.destination_port = datagram.destination_port;
  write(datagram.receive_stamp, addresses, datagram.payload);
}

void PcapWriter::write_frame(Stamp stamp, std::span<const std::byte> frame, std::size_t snap_length) {
  pcap_pkthdr header{};
  header.ts.tv_sec = to_ns(stamp) / 1'000'000'000;
  header.ts.tv_usec = to_ns(stamp) % 1'000'000'000; // nanoseconds, because of the file's precision
  header.len = static_cast<bpf_u_int32>(frame.size());
  header.caplen = static_cast<bpf_u_int32>(std::min(frame.size(), snap_length));
  const std::span<const std::byte> kept = frame.first(header.caplen);
  pcap_dump(reinterpret_cast<u_char*>(dumper_.get()), &header, reinterpret_cast<const u_char*>(kept.data()));
  bytes_ += kRecordHeaderBytes + kept.size();
}

std::optional<std::string> PcapWriter::flush() {
  const bool flushed = pcap_dump_flush(dumper_.get()) == 0;
  return flushed && std::ferror(pcap_dump_file(dumper_.get())) == 0 ? std::nullopt : std::optional{cannot_be_written()};
}

int PcapWriter::descriptor() const { return fileno(pcap_dump_file(dumper_.get())); }

std::string PcapWriter::cannot_be_written() const {
  return fmt::format("{}: cannot be written ({}); check permissions and free space", file_.string(),
                     std::generic_category().message(errno));
}

} // namespace locus
