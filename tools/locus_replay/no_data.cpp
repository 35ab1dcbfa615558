// SPDX-License-Identifier: Apache-2.0
#include "locus_replay/no_data.hpp"

#include <algorithm>
#include <vector>

#include <fmt/format.h>

namespace locus::tools {
namespace {

std::string dotted(std::uint32_t ip) {
  return fmt::format("{}.{}.{}.{}", ip >> 24U, ip >> 16U & 0xFFU, ip >> 8U & 0xFFU, ip & 0xFFU);
}

std::string rejections(const PacketCounters& counters) {
  std::vector<std::string> reasons;
  for (std::size_t i = 0; i < kPacketErrorCount; ++i) {
    if (counters.rejected[i] > 0)
      reasons.push_back(fmt::format("{} {}", kPacketErrorNames[i], counters.rejected[i]));
  }
  return fmt::format("{}", fmt::join(reasons, ", "));
}

std::string without_datagrams(const Capture::Stats& seen) {
  if (seen.datagrams > 0)
    return fmt::format("none of its {} UDP datagrams lies within --start and --duration; choose another part",
                       seen.datagrams);
  return fmt::format("no UDP datagram in {} frames; record next to the lidar with: tcpdump -s 0 -w lidar.pcap udp",
                     seen.frames);
}

} // namespace

std::string why_no_data(const Recording& recording, const LidarRouter& lidars) {
  const std::map<std::uint16_t, PortTraffic>& traffic = recording.traffic();
  if (traffic.empty())
    return without_datagrams(recording.capture().stats());
  const auto& [port, busiest] = *std::ranges::max_element(
      traffic, {}, [](const auto& entry) { return std::pair(entry.second.data_packet_sized, entry.second.datagrams); });
  const LidarOptions& first = lidars.lidars().front().options();
  const bool configured = std::ranges::any_of(
      lidars.lidars(), [&, port = port](const LidarInput& lidar) { return lidar.listens_to(port); });
  if (busiest.data_packet_sized == 0)
    return fmt::format("none of its UDP datagrams has the size of a data packet, 1206 bytes; most ({}) go to port {}; "
                       "record the lidar's data port",
                       busiest.datagrams, port);
  if (!configured)
    return fmt::format("{} packets to port {}, configured {}; use --set lidars.0.port={}", busiest.data_packet_sized,
                       port, first.port, port);
  const PacketCounters total = lidars.total();
  if (first.source_ip && total[PacketError::sender] > 0)
    return fmt::format("{} packets to port {} come from {}, configured {}; use --set lidars.0.source_ip={}",
                       busiest.data_packet_sized, port, dotted(busiest.source_ip), dotted(*first.source_ip),
                       dotted(busiest.source_ip));
  return fmt::format("{} packets to port {}, rejected: {}; is it a Velodyne, and lidars.0.model the right one?",
                     busiest.data_packet_sized, port, rejections(total));
}

} // namespace locus::tools
