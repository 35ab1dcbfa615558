// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "drivers/files/pcap_writer.hpp"
#include "locus_sim/capture_sink.hpp"
#include "locus_sim/stream_text.hpp"

namespace locus::sim {

/// Capture on standard output, to be played as it is produced (`locus-sim -o - | locus-play -`).
///
/// The stream is a pcap file (nanoseconds, Ethernet, IPv4, UDP), its packets in order of arrival. The lidars' datagrams
/// are stored as in lidar.pcap. The other files of a capture folder are split: a datagram from 127.0.0.1 to 127.0.0.1,
/// port 9, has as payload the name of the file, a line feed, and whole lines to append to it. config.yaml comes first
/// and in one piece, its packet stamped with the start. There is no gt_map.ply: observed space is known only at the
/// end. Any reader of pcap files can open the stream, and everything but the texts can be replayed.
class StreamSink : public CaptureSink {
 public:
  StreamSink();

  void datagram(const Datagram& datagram) override { pcap_.write(datagram); }
  void text(std::string_view file, Stamp arrival, const std::string& lines) override;
  void close() override;

 private:
  PcapWriter pcap_;
};

} // namespace locus::sim
