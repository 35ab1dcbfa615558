// SPDX-License-Identifier: Apache-2.0
#include "locus_replay/lidar_doubts.hpp"
#include "daemon/figures.hpp"
#include "drivers/net/datagram.hpp"

#include <algorithm>
#include <optional>
#include <vector>

#include <fmt/format.h>

namespace locus::tools {
namespace {

std::string rejections(const PacketCounters& counters) {
  std::vector<std::string> reasons;
  for (std::size_t i = 0; i < kPacketErrorCount; ++i) {
    if (counters.rejected[i] > 0)
      reasons.push_back(fmt::format("{} {}", to_string(static_cast<PacketError>(i)), counters.rejected[i]));
  }
  return fmt::format("{}", fmt::join(reasons, ", "));
}

/// Of what model the packets say that they are, where it is unknown.
std::string unknown_model(const LidarInput& lidar) {
  const auto unknown = lidar.decoder().unknown_packets();
  return unknown ? fmt::format(" ({})", velodyne::to_string(*unknown)) : "";
}

bool is_configured(const LidarRouter& lidars, std::uint16_t port) {
  return std::ranges::any_of(lidars.lidars(), [&](const LidarInput& lidar) { return lidar.listens_to(port); });
}

/// The model that the packets of a lidar speak of, where it is another than the configured one.
std::optional<velodyne::Model> other_model(const LidarInput& lidar) {
  const auto recognised = lidar.decoder().recognised_model();
  return lidar.options().model && recognised != lidar.options().model ? recognised : std::nullopt;
}

/// The faults that can keep every packet of a lidar back, as --fail has them.
std::vector<std::string> losses_of(const LidarInput& lidar, const Recording& recording) {
  std::vector<std::string> losses;
  for (const Fault& fault : recording.faults()) {
    const bool can_lose_all = fault.kind == FaultKind::lost || fault.kind == FaultKind::packet_loss;
    if (can_lose_all && fault.strikes_lidar(lidar.options().name))
      losses.push_back(fmt::format("{}:{}", fault.name, to_string(fault.kind)));
  }
  return losses;
}

/// Packets went to its port, and none of them came to it: what --fail asked for. Position packets may be another's.
bool lost_by_request(const LidarInput& lidar, const Recording& recording) {
  const auto listens = [&](const auto& entry) { return lidar.listens_to(entry.first); };
  return lidar.counters().received == lidar.counters().position && !losses_of(lidar, recording).empty() &&
         std::ranges::any_of(recording.traffic(), listens);
}

std::string not_heard(const LidarInput& lidar, const Recording& recording, const LidarRouter& lidars) {
  const LidarOptions& options = lidar.options();
  std::string line = fmt::format("lidar {}: no valid data packet to port {}", options.name, options.port);
  if (options.source_ip)
    line += " from " + dotted(*options.source_ip);
  if (const std::string rejected = rejections(lidar.counters()); !rejected.empty())
    return fmt::format("{}, rejected: {}{}; check its address and model", line, rejected, unknown_model(lidar));
  for (const auto& [port, traffic] : recording.traffic()) {
    if (traffic.data_packet_sized > 0 && !is_configured(lidars, port))
      return fmt::format("{}; {} packets went to port {}: if they are its own, use --set lidars.{}.port={}", line,
                         traffic.data_packet_sized, port, options.name, port);
  }
  return line + "; check its port and address, or take it out of the configuration";
}

/// Whose packets these are, where most that could be a lidar's look like another maker's.
std::string other_makers(const std::map<std::uint16_t, PortTraffic>& traffic) {
  for (const OtherMaker maker : {OtherMaker::hesai, OtherMaker::ouster}) {
    const auto packets_of = [&](const auto& entry) {
      return entry.second.of_other_maker[static_cast<std::size_t>(maker)];
    };
    const auto& [port, busiest] = *std::ranges::max_element(traffic, {}, packets_of);
    std::uint64_t packets = 0, velodyne = 0;
    for (const auto& entry : traffic) {
      packets += packets_of(entry);
      velodyne += entry.second.data_packet_sized;
    }
    if (packets > velodyne)
      return fmt::format("{} packets look like those of a lidar of {} (most go to port {}, the last of them with {} "
                         "bytes); only Velodyne's are decoded, so record one of those",
                         packets, to_string(maker), port, busiest.bytes);
  }
  return "";
}

std::string without_datagrams(const DatagramSource& source) {
  if (source.datagrams() == 0)
    return source.why_none();
  return fmt::format("none of its {} UDP datagrams lies within --start and --duration; choose another part",
                     source.datagrams());
}

} // namespace

std::string why_no_data(const Recording& recording, const LidarRouter& lidars) {
  const std::map<std::uint16_t, PortTraffic>& traffic = recording.traffic();
  if (traffic.empty())
    return without_datagrams(recording.source());
  if (std::string maker = other_makers(traffic); !maker.empty())
    return maker;
  const auto& [port, busiest] = *std::ranges::max_element(
      traffic, {}, [](const auto& entry) { return std::pair(entry.second.data_packet_sized, entry.second.datagrams); });
  const LidarOptions& first = lidars.lidars().front().options();
  if (busiest.data_packet_sized == 0)
    return fmt::format("none of its UDP datagrams has the size of a data packet, 1206 bytes; most ({}) go to port {}; "
                       "record the lidar's data port",
                       busiest.datagrams, port);
  if (!is_configured(lidars, port))
    return fmt::format("{} packets to port {}, configured {}; use --set lidars.0.port={}", busiest.data_packet_sized,
                       port, first.port, port);
  const LidarInput& lidar =
      *std::ranges::find_if(lidars.lidars(), [port = port](const LidarInput& l) { return l.listens_to(port); });
  if (lost_by_request(lidar, recording))
    return fmt::format("--fail {} keeps all {} packets to port {} back; let some through, for example with @10-20",
                       fmt::join(losses_of(lidar, recording), " and "), busiest.data_packet_sized, port);
  const PacketCounters total = lidars.total();
  if (first.source_ip && total[PacketError::sender] > 0)
    return fmt::format("{} packets to port {} come from {}, configured {}; use --set lidars.0.source_ip={}",
                       busiest.data_packet_sized, port, dotted(busiest.source_ip), dotted(*first.source_ip),
                       dotted(busiest.source_ip));
  if (const auto model = other_model(lidars.lidars().front()))
    return fmt::format("{} packets to port {}, those of a {}, configured {}; use --set lidars.0.model=auto",
                       busiest.data_packet_sized, port, to_string(*model), to_string(*first.model));
  return fmt::format("{} packets to port {}, rejected: {}{}; is it a Velodyne, and lidars.0.model the right one?",
                     busiest.data_packet_sized, port, rejections(total), unknown_model(lidar));
}

std::vector<std::string> lidar_warnings(const Recording& recording, const LidarRouter& lidars,
                                        const SweepOptions& sweeps) {
  std::vector<std::string> warnings;
  for (const LidarInput& lidar : lidars.lidars()) {
    if (lidar.counters().data == 0 && !lost_by_request(lidar, recording))
      warnings.push_back(not_heard(lidar, recording, lidars));
    if (const auto model = other_model(lidar))
      warnings.push_back(fmt::format("lidar {0}: configured as {1}, but its packets are those of a {2}, and read as a "
                                     "{1}'s they make a wrong world; use --set lidars.{0}.model=auto",
                                     lidar.options().name, to_string(*lidar.options().model), to_string(*model)));
    const auto report = daemon::IngestReport::Lidar::of(lidar);
    if (auto warning = report.packets.data > 0 ? daemon::unknown_model(lidar.options(), report) : std::nullopt)
      warnings.push_back(std::move(*warning));
    if (auto warning = daemon::shared_port(lidar.options(), report))
      warnings.push_back(std::move(*warning));
    if (auto warning = lidar.decoder().model()
                           ? daemon::short_sweep(sweeps, lidar.options().name, lidar.decoder().rotation_rate_rpm())
                           : std::nullopt)
      warnings.push_back(std::move(*warning));
  }
  return warnings;
}

} // namespace locus::tools
