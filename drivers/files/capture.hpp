// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <sys/time.h>

#include "core/base/expected.hpp"
#include "drivers/files/byte_stream.hpp"
#include "drivers/files/pcapng_reader.hpp"
#include "drivers/files/udp_frame.hpp"
#include "drivers/net/datagram.hpp"

struct pcap;

namespace locus {

/// Reads the UDP datagrams of a capture file, pcap or pcapng, in recorded order.
///
/// A pcapng file may have several sections, and interfaces of different kinds; frames of those that are not read are
/// skipped. Link types: Ethernet with any VLAN tags, Linux cooked (SLL, SLL2), loopback, raw IP. Frames that neither
/// hold nor complete an IPv4 UDP datagram are counted and skipped. A truncated or damaged file is read up to that
/// point, and warnings() reports it. Single owner, not thread-safe. Allocates nothing per packet.
class Capture : public DatagramSource {
 public:
  /// Counters of the frames so far: frames = datagrams + not_ip + ipv6 + fragments + not_udp + malformed.
  struct Stats {
    std::uint64_t frames = 0;
    std::uint64_t datagrams = 0;
    std::uint64_t truncated = 0; ///< datagrams with an incomplete payload, because of the capture's snap length
    std::uint64_t not_ip = 0;
    std::uint64_t ipv6 = 0;
    std::uint64_t fragments = 0; ///< fragments that complete no datagram
    std::uint64_t not_udp = 0;
    std::uint64_t malformed = 0; ///< contradictory lengths, truncated headers, or a time beyond the year 2096
  };

  /// Opens a capture; "-" is standard input. Fails with one line for the user if the file cannot be read, is not a
  /// capture or has an unsupported link type.
  static Expected<Capture, std::string> open(const std::filesystem::path& file);
  /// Opens a stream in the same way; `name` stands for it in messages.
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

  Capture(std::filesystem::path file, pcap* handle, std::unique_ptr<PcapngReader> pcapng, const ByteStream& stream);
  std::optional<CapturedFrame> next_frame();
  std::optional<Stamp> stamp_of(const timeval& time);
  void note_break(std::FILE* file, std::string_view why);

  std::filesystem::path file_;
  std::unique_ptr<pcap, Closer> pcap_;   ///< nullptr for pcapng
  std::unique_ptr<PcapngReader> pcapng_; ///< nullptr for pcap
  const ByteStream* stream_;             ///< source of either, which owns it
  IpFragments fragments_;
  Datagram datagram_;
  Stats stats_;
  std::uint64_t within_a_second_ = 0, beyond_a_second_ = 0; ///< frames by the fraction of their time
  std::optional<int> foreign_link_type_;                    ///< of a frame that is not read
  std::string break_; ///< where and why reading stopped early; empty if it did not
};

} // namespace locus
