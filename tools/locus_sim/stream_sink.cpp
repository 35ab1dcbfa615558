// SPDX-License-Identifier: Apache-2.0
#include "locus_sim/stream_sink.hpp"

#include <fmt/format.h>

#include <span>

namespace locus::sim {

void StreamSink::text(std::string_view file, Stamp arrival, const std::string& lines) {
  const std::string payload = fmt::format("{}\n{}", file, lines);
  pcap_.write(arrival, kTextAddress, kTextPort, kTextAddress, kTextPort, std::as_bytes(std::span(payload)));
}

} // namespace locus::sim
