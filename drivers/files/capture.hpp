// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "core/base/expected.hpp"
#include "drivers/files/byte_stream.hpp"
#include "drivers/files/udp_frame.hpp"
#include "drivers/net/datagram.hpp"

struct pcap;

namespace locus {

/// Reads the UDP datagrams of a recorded capture, pcap or pcapng, in the order in which they were recorded.
///
/// Link types: Ethernet with any VLAN tags, Linux cooked (SLL, SLL2), loopback, raw IP. Whatever is not a whole IPv4
/// UDP datagram, or completes one, is counted and skipped. A file that breaks off is read up to the break, and
/// warnings() says where that is. One owner. Allocates nothing from packet to packet.
class Capture : public DatagramSource {
 public:
  /// What became of the frames so far: frames = datagrams + not_ip + ipv6 + fragments + not_udp + malformed.
  struct Stats {
    std::uint64_t frames = 0;
    std::uint64_t datagrams = 0;
    std::uint64_t truncated = 0; ///< datagrams with part of the payload missing, because of the capture's snap length
    std::uint64_t not_ip = 0;
    std::uint64_t ipv6 = 0;
    std::uint64_t fragments = 0; ///< that complete no datagram
    std::uint64_t not_udp = 0;
    std::uint64_t malformed = 0; ///< lengths that contradict each other, headers cut short, a time beyond the year 2096
  };

  /// "-" is standard input. Fails with one line for the user when the file cannot be read, is not a capture or has a
  /// foreign link type.
  static Expected<Capture, std::string> open(const std::filesystem::path& file);
  /// The same of a stream; `name` is what messages call it.
  static Expected<Capture, std::string> open(std::unique_ptr<ByteStream> stream, const std::filesystem::path& name);

  const Datagram* next() override;

  [[nodiscard]] const Stats& stats() const { return stats_; }
  [[nodiscard]] std::uint64_t datagrams() const override { return stats_.datagrams; }
  [[nodiscard]] std::string why_none() const override;
  [[nodiscard]] std::vector<std::string> warnings() const override;
  [[nodiscard]] double progress() const override;

 private:
  struct Closer {
    void operator()(pcap* handle) const;
  };

  struct Feed;

  Capture(std::filesystem::path file, pcap* handle, const ByteStream& stream);
  void note_break();

  std::filesystem::path file_;
  std::unique_ptr<pcap, Closer> pcap_;
  const ByteStream* stream_; ///< what pcap_ reads from and owns
  IpFragments fragments_;
  Datagram datagram_;
  Stats stats_;
  std::string break_; ///< where and why reading stopped before the end; empty while all is well
};

} // namespace locus
