// SPDX-License-Identifier: Apache-2.0
#include "locusctl/sensors.hpp"

#include <algorithm>
#include <array>
#include <map>
#include <vector>

#include <fmt/format.h>

#include "drivers/lidar_input.hpp"
#include "drivers/lidar_survey.hpp"
#include "drivers/net/wire_tap.hpp"
#include "locus_replay/failure.hpp"
#include "locusctl/lidar_entry.hpp"

namespace locus::tools {
namespace {

std::string describe(const SurveyedLidar& lidar) {
  const std::string beams = lidar.beams > 0 ? fmt::format("-{}", lidar.beams) : "";
  const std::string model = lidar.ouster ? "Ouster" + beams : std::string{lidar.model};
  std::string mode{lidar.return_mode};
  if (lidar.columns_per_turn > 0)
    mode = fmt::format("{}x{:.0f}", lidar.columns_per_turn, lidar.rotation_rate_rpm / 60.0);
  std::string text =
      fmt::format("{:<16}{:<7}{:<12}{:>5.0f} rpm  {:<10}{:>7.0f} packets/s  {}", dotted(lidar.ip), lidar.port, model,
                  lidar.rotation_rate_rpm, mode, lidar.packets_per_s, lidar.clock_state());
  if (lidar.ouster.value_or(0) > 0)
    text += fmt::format("  serial number {}", *lidar.ouster);
  return text + "\n";
}

std::string describe_unread(const SurveyedLidar& lidar) {
  const std::string_view help = remedy(*lidar.unknown_packets);
  return fmt::format("{:<16}{:<7}not read: {}{}{}\n", dotted(lidar.ip), lidar.port, to_string(*lidar.unknown_packets),
                     help.empty() ? "" : "; ", help);
}

/// Formats a configuration entry, and the command that fetches the file that only the sensor has: an Ouster requires
/// it.
std::string entry(const SurveyedLidar& lidar, int number, bool shares_port) {
  const std::string name = fmt::format("lidar{}", number), ip = dotted(lidar.ip);
  const std::string file = fmt::format("/etc/locusd/{}{}", name, lidar.ouster ? ".json" : ".csv");
  const std::string model = lidar.ouster ? "Ouster, metadata: " + file : std::string{lidar.model};
  std::string yaml = lidar_entry(
      name, fmt::format("model: {}, port: {}{}", model, lidar.port, shares_port ? ", source_ip: " + ip : ""));
  if (lidar.ouster)
    yaml += fmt::format("    # locusctl fetch {} -o {}\n", ip, file);
  else if (lidar.clock) // Hesai
    yaml += fmt::format("    # calibration: {1} has its own angles, after: locusctl fetch {0} -o {1}\n", ip, file);
  return yaml;
}

} // namespace

std::string find_sensors(Duration duration) {
  constexpr std::uint16_t kRoboSensePort = 6699, kSeyondPort = 8010, kLivoxPort = 56301;
  constexpr std::array kDefaultPorts{kDefaultDataPort, kDefaultPositionPort, ouster::kDefaultLidarPort,
                                     kRoboSensePort,   kSeyondPort,          kLivoxPort};
  auto wire = WireTap::open(kDefaultPorts);
  if (!wire)
    throw Failure(ExitStatus::failed, wire.error());
  LidarSurvey survey;
  wire->listen(duration, [&](const Datagram& datagram) { survey.add(datagram); });

  const std::vector<SurveyedLidar> lidars = survey.lidars();
  std::map<std::uint16_t, int> on_port;
  for (const SurveyedLidar& lidar : lidars)
    on_port[lidar.port] += lidar.is_known() ? 1 : 0;
  std::string text, refused, yaml;
  int known = 0;
  for (const SurveyedLidar& lidar : lidars) {
    if (lidar.unknown_packets)
      refused += describe_unread(lidar);
    if (!lidar.is_known())
      continue;
    text += describe(lidar);
    yaml += entry(lidar, ++known, on_port[lidar.port] > 1);
  }
  if (text.empty())
    throw Failure(
        ExitStatus::failed,
        fmt::format("{}no lidar {}was received within {:.0f} s; check power, cable and the address it sends to",
                    refused, refused.empty() ? "" : "that can be read ", to_seconds(duration)));
  return text + refused + "\nlidars:\n" + yaml;
}

} // namespace locus::tools
