// SPDX-License-Identifier: Apache-2.0
// Captures and their frames.
#include "drivers/files/capture.hpp"
#include "fuzz/memory_file.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace locus;
  using fuzz::demand;
  static const fuzz::MemoryFile kFile;
  auto capture = Capture::open(kFile.with(fuzz::text_of(data, size)));
  if (!capture)
    return 0;
  while (const Datagram* const datagram = capture->next()) {
    demand(datagram->payload.size() <= size);
    for (const std::byte byte : datagram->payload) // each must be readable
      demand(std::to_integer<unsigned>(byte) < 256);
  }
  const Capture::Stats& s = capture->stats();
  demand(s.frames == s.datagrams + s.not_ip + s.ipv6 + s.fragments + s.not_udp + s.malformed);
  demand(s.truncated <= s.datagrams);
  static_cast<void>(capture->warnings());
  return 0;
}
