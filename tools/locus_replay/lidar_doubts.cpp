// SPDX-License-Identifier: Apache-2.0
#include "locus_replay/lidar_doubts.hpp"
#include "drivers/net/datagram.hpp"

#include <algorithm>
#include <iterator>
#include <optional>
#include <set>
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

std::string refusals(const CloudCounters& counters) {
  std::vector<std::string> reasons;
  for (std::size_t i = 0; i < kCloudErrors; ++i) {
    if (counters.refused[i] > 0)
      reasons.push_back(fmt::format("{} {}", to_string(static_cast<CloudError>(i)), counters.refused[i]));
  }
  return fmt::format("{}", fmt::join(reasons, ", "));
}

/// Names the model that the packets report, if it is unknown.
std::string unknown_model(const LidarInput& lidar) {
  const auto unknown = lidar.decoder().unknown_packets();
  return unknown ? fmt::format(" ({})", to_string(*unknown)) : "";
}

bool is_configured(const LidarRouter& lidars, std::uint16_t port) {
  return std::ranges::any_of(lidars.lidars(), [&](const LidarInput& lidar) { return lidar.listens_to(port); });
}

/// Returns the model that the packets of a lidar report, if it differs from the configured one.
std::optional<std::string_view> other_model(const LidarInput& lidar) {
  const std::string_view recognised = lidar.decoder().recognised_model();
  const bool is_other = !configured_model(lidar.options()).empty() && !recognised.empty() &&
                        recognised != configured_model(lidar.options());
  return is_other ? std::optional{recognised} : std::nullopt;
}

/// Lists the faults of --fail that can drop every packet of a lidar.
std::vector<std::string> losses_of(const LidarInput& lidar, const Recording& recording) {
  std::vector<std::string> losses;
  for (const Fault& fault : recording.faults()) {
    const bool can_lose_all = fault.kind == FaultKind::lost || fault.kind == FaultKind::packet_loss;
    if (can_lose_all && fault.strikes_lidar(lidar.options().name))
      losses.push_back(fmt::format("{}:{}", fault.name, to_string(fault.kind)));
  }
  return losses;
}

/// Returns whether --fail dropped all packets to the lidar's port. Position packets may belong to another lidar.
bool lost_by_request(const LidarInput& lidar, const Recording& recording) {
  const auto listens = [&](const auto& entry) { return lidar.listens_to(entry.first); };
  return lidar.counters().received == lidar.counters().position && !losses_of(lidar, recording).empty() &&
         std::ranges::any_of(recording.traffic(), listens);
}

std::uint64_t of_length(const PortTraffic& traffic, std::size_t bytes) {
  const auto found = traffic.by_length.find(bytes);
  return found == traffic.by_length.end() ? 0 : found->second;
}

/// Returns the number of datagrams of a length to all ports.
std::uint64_t total_of(const std::map<std::uint16_t, PortTraffic>& traffic, std::size_t bytes) {
  std::uint64_t datagrams = 0;
  for (const auto& entry : traffic)
    datagrams += of_length(entry.second, bytes);
  return datagrams;
}

/// Returns the lengths of the lidars' data packets.
std::set<std::size_t> data_packet_lengths(const LidarRouter& lidars) {
  std::set<std::size_t> lengths;
  for (const LidarInput& lidar : lidars.lidars())
    if (!lidar.options().gives_clouds()) {
      const PacketLengths of_lidar = lidar.decoder().lengths();
      lengths.insert(of_lidar.of_data().begin(), of_lidar.of_data().end());
    }
  return lengths;
}

/// Counts datagrams whose length is that of a data packet.
std::uint64_t data_packet_sized(const PortTraffic& traffic, const std::set<std::size_t>& lengths) {
  std::uint64_t datagrams = 0;
  for (const std::size_t length : lengths)
    datagrams += of_length(traffic, length);
  return datagrams;
}

/// Returns whether an Ouster received datagrams, none of which matched its metadata. Datagrams from an address other
/// than the configured one are a different problem.
bool fits_no_packet(const LidarInput& lidar) {
  const PacketCounters& counters = lidar.counters();
  return lidar.options().is_ouster() && counters.data == 0 && !rejections(counters).empty() &&
         !(lidar.options().source_ip && counters[PacketError::sender] > 0);
}

std::string metadata_of_another(const LidarInput& lidar) {
  const PacketCounters& counters = lidar.counters();
  return fmt::format("{} datagrams to port {} of lidar {}, rejected: {}; is {} the metadata of this sensor, as it was "
                     "configured then?",
                     counters.received - counters.position, lidar.options().port, lidar.options().name,
                     rejections(counters), lidar.options().metadata);
}

std::string not_heard(const LidarInput& lidar, const Recording& recording, const LidarRouter& lidars) {
  if (fits_no_packet(lidar))
    return metadata_of_another(lidar);
  const LidarOptions& options = lidar.options();
  std::string line = fmt::format("lidar {}: no valid data packet to port {}", options.name, options.port);
  if (options.source_ip)
    line += " from " + dotted(*options.source_ip);
  if (const std::string rejected = rejections(lidar.counters()); !rejected.empty())
    return fmt::format("{}, rejected: {}{}; check its address and model", line, rejected, unknown_model(lidar));
  for (const auto& [port, traffic] : recording.traffic()) {
    const PacketLengths lengths = lidar.decoder().lengths();
    const std::uint64_t packets = data_packet_sized(traffic, {lengths.of_data().begin(), lengths.of_data().end()});
    if (packets > 0 && !is_configured(lidars, port))
      return fmt::format("{}; {} packets went to port {}: if they are its own, use --set lidars.{}.port={}", line,
                         packets, port, options.name, port);
  }
  return line + "; check its port and address, or remove it from the configuration";
}

/// Names the maker if most packets that could be a lidar's look like another maker's.
std::string other_makers(const std::map<std::uint16_t, PortTraffic>& traffic, const LidarRouter& lidars) {
  const bool has_ouster =
      std::ranges::any_of(lidars.lidars(), [](const auto& one) { return one.options().is_ouster(); });
  for (std::size_t i = 0; i < kOtherMakers; ++i) {
    const auto maker = static_cast<OtherMaker>(i);
    const auto packets_of = [&](const auto& entry) {
      return entry.second.of_other_maker[static_cast<std::size_t>(maker)];
    };
    const auto& [port, busiest] = *std::ranges::max_element(traffic, {}, packets_of);
    std::uint64_t packets = 0, of_imu = 0, velodyne = 0;
    for (const auto& entry : traffic) {
      packets += packets_of(entry);
      of_imu += entry.second.of_ouster_imu;
      velodyne += of_length(entry.second, velodyne::kDataPacketBytes);
    }
    if (packets <= velodyne)
      continue;
    if (maker == OtherMaker::ouster && packets == of_imu)
      return fmt::format("{} packets of the inertial unit of an Ouster (most go to port {}), but none of its columns; "
                         "record its lidar port as well, mostly {}",
                         packets, port, ouster::kDefaultLidarPort);
    if (maker == OtherMaker::ouster && has_ouster)
      continue;
    if (maker == OtherMaker::ouster)
      return fmt::format(
          "{} packets look like those of a lidar of Ouster (most go to port {}, the last of them with {} "
          "bytes), but no metadata of it is named, and there is not exactly one file of them beside the capture; fetch "
          "it in the mode of the recording: locusctl "
          "fetch SENSOR -o drive.json for a drive.pcap, or name it: --set "
          "lidars.0.metadata=FILE --set lidars.0.port={}",
          packets, port, busiest.bytes, port);
    const std::string_view model = maker == OtherMaker::hesai ? busiest.hesai : std::string_view{};
    return fmt::format("{} packets look like those of a {}{}{} (most go to port {}, the last of them with {} "
                       "bytes), which are not read; record clouds of its driver, or another lidar",
                       packets, to_string(maker), model.empty() ? "" : " ", model, port, busiest.bytes);
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
  if (std::string maker = other_makers(traffic, lidars); !maker.empty())
    return maker;
  if (const auto refused = std::ranges::find_if(lidars.lidars(), fits_no_packet); refused != lidars.lidars().end())
    return metadata_of_another(*refused);
  const std::set<std::size_t> lengths = data_packet_lengths(lidars);
  const auto& [port, busiest] = *std::ranges::max_element(traffic, {}, [&](const auto& entry) {
    return std::pair(data_packet_sized(entry.second, lengths), entry.second.datagrams);
  });
  const std::uint64_t packets = data_packet_sized(busiest, lengths);
  const LidarOptions& first = lidars.lidars().front().options();
  const auto of_other_model = [&, port = port](std::uint64_t datagrams) {
    const auto model = other_model(lidars.lidars().front());
    return model ? fmt::format("{} packets to port {}, those of a {}, configured {}; use --set lidars.0.model=auto",
                               datagrams, port, *model, configured_model(first))
                 : "";
  };
  if (std::string other = of_other_model(busiest.datagrams); packets == 0 && !other.empty())
    return other;
  if (const std::uint64_t positions = total_of(traffic, velodyne::kPositionPacketBytes); packets == 0 && positions > 0)
    return fmt::format(
        "it contains {} position packets of a Velodyne and no data packet: the lidar is present and sends "
        "none, because its laser or motor is off, or they go to another address; switch them on and check "
        "the destination on the lidar's web page, or record the data port as well, mostly {}",
        positions, kDefaultDataPort);
  if (packets == 0)
    return fmt::format("none of its UDP datagrams has the size of a data packet, {} bytes; most ({}) go to port {}; "
                       "record the lidar's data port",
                       fmt::join(lengths, " or "), busiest.datagrams, port);
  if (!is_configured(lidars, port))
    return fmt::format("{} packets to port {}, configured {}; use --set lidars.0.port={}", packets, port, first.port,
                       port);
  const LidarInput& lidar =
      *std::ranges::find_if(lidars.lidars(), [port = port](const LidarInput& l) { return l.listens_to(port); });
  if (lost_by_request(lidar, recording))
    return fmt::format("--fail {} removes all {} packets to port {}; limit its time, for example with @10-20",
                       fmt::join(losses_of(lidar, recording), " and "), packets, port);
  const PacketCounters total = lidars.total();
  if (first.source_ip && total[PacketError::sender] > 0)
    return fmt::format("{} packets to port {} come from {}, configured {}; use --set lidars.0.source_ip={}", packets,
                       port, dotted(busiest.source_ip), dotted(*first.source_ip), dotted(busiest.source_ip));
  if (std::string other = of_other_model(packets); !other.empty())
    return other;
  return fmt::format("{} packets to port {}, rejected: {}{}; is it a lidar whose packets can be read, and "
                     "lidars.0.model the right one?",
                     packets, port, rejections(total), unknown_model(lidar));
}

std::string why_no_clouds(const daemon::Figures& figures) {
  std::vector<std::string> lines;
  for (std::size_t i = 0; i < figures.config.lidars.size(); ++i) {
    const auto& clouds = figures.ingest.lidars[i].clouds;
    if (clouds && clouds->counters.received > 0)
      lines.push_back(fmt::format("{} clouds on {}, rejected: {}; choose another topic, or check what its driver "
                                  "publishes",
                                  clouds->counters.received, figures.config.lidars[i].topic,
                                  refusals(clouds->counters)));
  }
  return fmt::format("{}", fmt::join(lines, "; "));
}

std::vector<std::string> cloud_warnings(const daemon::Figures& figures) {
  std::vector<std::string> warnings;
  for (std::size_t i = 0; i < figures.config.lidars.size(); ++i) {
    const LidarOptions& options = figures.config.lidars[i];
    const daemon::IngestReport::Lidar& lidar = figures.ingest.lidars[i];
    if (!lidar.clouds)
      continue;
    const CloudCounters& counters = lidar.clouds->counters;
    if (counters.received == 0)
      warnings.push_back(fmt::format("lidar {}: no cloud on {}; name its topic, or remove it from the configuration",
                                     options.name, options.topic));
    else if (counters.used < counters.received)
      warnings.push_back(fmt::format("lidar {}: {} of {} clouds on {} rejected: {}", options.name,
                                     counters.received - counters.used, counters.received, options.topic,
                                     refusals(counters)));
    std::ranges::move(daemon::cloud_doubts(options, lidar), std::back_inserter(warnings));
  }
  return warnings;
}

std::vector<std::string> lidar_warnings(const Recording& recording, const LidarRouter& lidars,
                                        const SweepOptions& sweeps) {
  std::vector<std::string> warnings;
  for (const LidarInput& lidar : lidars.lidars()) {
    if (lidar.options().gives_clouds())
      continue;
    if (lidar.counters().data == 0 && !lost_by_request(lidar, recording))
      warnings.push_back(not_heard(lidar, recording, lidars));
    if (const auto model = other_model(lidar))
      warnings.push_back(fmt::format("lidar {0}: configured as {1}, but its packets are those of a {2}; decoded as a "
                                     "{1}'s, their points are wrong; use --set lidars.{0}.model=auto",
                                     lidar.options().name, configured_model(lidar.options()), *model));
    const auto report = daemon::IngestReport::Lidar::of(lidar);
    if (auto warning = report.packets.data > 0 ? daemon::unknown_model(lidar.options(), report) : std::nullopt)
      warnings.push_back(std::move(*warning));
    if (auto warning = daemon::shared_port(lidar.options(), report))
      warnings.push_back(std::move(*warning));
    if (auto warning = daemon::stale_metadata(lidar.options(), report))
      warnings.push_back(std::move(*warning));
    if (auto warning = daemon::unused_pps(lidar.options(), report))
      warnings.push_back(std::move(*warning));
    if (auto warning = daemon::short_sweep(sweeps, lidar.options().name, report.rotation_rate_rpm))
      warnings.push_back(std::move(*warning));
  }
  return warnings;
}

} // namespace locus::tools
