// SPDX-License-Identifier: Apache-2.0
#include "daemon/service/lidar_sockets.hpp"

#include <algorithm>
#include <map>
#include <utility>

#include <fcntl.h>
#include <fmt/format.h>
#include <systemd/sd-daemon.h>

#include "drivers/lidar_input.hpp"

namespace locus::daemon {

namespace {

/// With whether the service is of no use without it: position packets tell the time, and are missed by nobody else.
std::map<std::uint16_t, bool> ports_of(const Config& config) {
  constexpr int kDistance = kDefaultPositionPort - kDefaultDataPort;
  std::map<std::uint16_t, bool> ports{{kDefaultPositionPort, false}};
  for (const LidarOptions& lidar : config.lidars) {
    ports[lidar.port] = true;
    if (lidar.port + kDistance <= UINT16_MAX)
      ports.try_emplace(static_cast<std::uint16_t>(lidar.port + kDistance), false);
  }
  return ports;
}

} // namespace

std::vector<int> inherited_sockets() {
  std::vector<int> descriptors;
  const int count = sd_listen_fds(1);
  for (int i = 0; i < count; ++i)
    if (const int descriptor = SD_LISTEN_FDS_START + i; sd_is_socket(descriptor, AF_UNSPEC, SOCK_DGRAM, -1) > 0)
      descriptors.push_back(descriptor);
  return descriptors;
}

Expected<std::vector<UdpSocket>, std::string> open_lidar_sockets(const Config& config, std::span<const int> inherited,
                                                                 Log& log) {
  std::vector<UdpSocket> sockets;
  std::map<std::uint16_t, bool> ports = ports_of(config);
  for (const int descriptor : inherited) {
    auto socket = UdpSocket::adopt(fcntl(descriptor, F_DUPFD_CLOEXEC, 0));
    if (!socket)
      return socket.error();
    if (ports.erase(socket->port()) > 0)
      sockets.push_back(std::move(*socket));
    else
      log.warn(
          fmt::format("systemd listens to UDP port {}, but no lidar of the configuration sends there", socket->port()));
  }
  for (const auto& [port, needed] : ports) {
    auto socket = UdpSocket::open(port);
    if (socket)
      sockets.push_back(std::move(*socket));
    else if (needed)
      return socket.error();
    else
      log.warn(socket.error() + "; without position packets the time of lidars is that of their arrival");
  }
  const int least = std::ranges::min_element(sockets, {}, &UdpSocket::buffer_bytes)->buffer_bytes();
  if (least < UdpSocket::kWantedBufferBytes)
    log.warn(
        fmt::format("the kernel gives lidar sockets {} bytes of the {} asked for: packets will be lost under load; "
                    "sysctl net.core.rmem_max={}",
                    least, UdpSocket::kWantedBufferBytes, UdpSocket::kWantedBufferBytes));
  join_multicast(config, sockets);
  return sockets;
}

void join_multicast(const Config& config, std::span<const UdpSocket> sockets) {
  for (const LidarOptions& lidar : config.lidars)
    for (const UdpSocket& socket : sockets)
      if (lidar.multicast_ip)
        socket.join(*lidar.multicast_ip);
}

} // namespace locus::daemon
