// SPDX-License-Identifier: Apache-2.0
#include "locus_sim/stream_sink.hpp"

#include <fmt/format.h>

#include <span>

#include "locus_replay/failure.hpp"

namespace locus::sim {

StreamSink::StreamSink() : pcap_(tools::value_or_fail(PcapWriter::open("-"), tools::ExitStatus::failed)) {}

void StreamSink::text(std::string_view file, Stamp arrival, const std::string& lines) {
  const std::string payload = fmt::format("{}\n{}", file, lines);
  pcap_.write(arrival, {kTextAddress, kTextPort, kTextAddress, kTextPort}, std::as_bytes(std::span(payload)));
}

void StreamSink::close() {
  if (const auto problem = pcap_.flush())
    throw tools::Failure(tools::ExitStatus::failed, *problem);
}

} // namespace locus::sim
