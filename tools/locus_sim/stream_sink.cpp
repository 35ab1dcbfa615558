// SPDX-License-Identifier: Apache-2.0
#include "locus_sim/stream_sink.hpp"

#include <fmt/format.h>

#include <span>

namespace locus::sim {

void StreamSink::text(std::string_view file, Stamp arrival, const std::string& lines) {
  constexpr std::uint32_t kLoopback = 0x7F00'0001;
  const std::string payload = fmt::format("{}\n{}", file, lines);
  pcap_.write(arrival, kLoopback, kTextPort, kLoopback, kTextPort, std::as_bytes(std::span(payload)));
}

} // namespace locus::sim
