// SPDX-License-Identifier: Apache-2.0
#include "daemon/service/machine.hpp"

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <map>
#include <utility>

#include <fcntl.h>
#include <fmt/format.h>
#include <sched.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <systemd/sd-daemon.h>

#include "drivers/lidar_input.hpp"

namespace locus::daemon {

std::map<std::uint16_t, bool> lidar_ports(const Config& config) {
  constexpr int kDistance = kDefaultPositionPort - kDefaultDataPort;
  std::map<std::uint16_t, bool> ports;
  for (const LidarOptions& lidar : config.lidars) {
    if (lidar.gives_clouds())
      continue;
    ports[lidar.port] = true;
    if (lidar.is_ouster()) {
      if (lidar.imu_port != 0)
        ports.try_emplace(lidar.imu_port, false);
      continue;
    }
    if (lidar.is_hesai())
      continue;
    ports.try_emplace(kDefaultPositionPort, false);
    if (lidar.port + kDistance <= UINT16_MAX)
      ports.try_emplace(static_cast<std::uint16_t>(lidar.port + kDistance), false);
  }
  return ports;
}

namespace {

bool is_imu_port(const Config& config, std::uint16_t port) {
  return std::ranges::any_of(config.lidars,
                             [=](const LidarOptions& lidar) { return lidar.is_ouster() && lidar.imu_port == port; });
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
  std::map<std::uint16_t, bool> ports = lidar_ports(config);
  for (const int descriptor : inherited) {
    auto socket = UdpSocket::adopt(fcntl(descriptor, F_DUPFD_CLOEXEC, 0));
    if (!socket)
      return socket.error();
    if (ports.erase(socket->port()) > 0)
      sockets.push_back(std::move(*socket));
    else
      log.warn(fmt::format("systemd listens on UDP port {}, but no configured lidar sends to it", socket->port()));
  }
  for (const auto& [port, needed] : ports) {
    auto socket = needed ? UdpSocket::open(port) : UdpSocket::open_shared(port);
    if (socket)
      sockets.push_back(std::move(*socket));
    else if (needed)
      return socket.error();
    else
      log.warn(socket.error() + (is_imu_port(config, port)
                                     ? "; the IMU of the lidar is not received"
                                     : "; without position packets, lidar data has the time of its arrival"));
  }
  const auto smallest = std::ranges::min_element(sockets, {}, &UdpSocket::buffer_bytes);
  if (smallest == sockets.end()) // all lidars publish clouds
    return sockets;
  if (const int bytes = smallest->buffer_bytes(); bytes < UdpSocket::kWantedBufferBytes)
    log.warn(fmt::format("the kernel grants lidar sockets {} of the {} bytes requested: packets will be lost under "
                         "load; set sysctl net.core.rmem_max={}",
                         bytes, UdpSocket::kWantedBufferBytes, UdpSocket::kWantedBufferBytes));
  join_multicast(config, sockets);
  return sockets;
}

void join_multicast(const Config& config, std::span<const UdpSocket> sockets) {
  for (const LidarOptions& lidar : config.lidars)
    for (const UdpSocket& socket : sockets)
      if (lidar.multicast_ip)
        socket.join(*lidar.multicast_ip);
}

namespace {

std::string not_granted_text(const char* what, const char* advice) {
  return fmt::format("{} was not granted ({}); the service runs without it; {}", what, std::strerror(errno), // NOLINT
                     advice);
}

} // namespace

std::optional<std::string> lock_memory(bool wanted) {
  if ((wanted ? mlockall(MCL_CURRENT | MCL_FUTURE) : munlockall()) == 0)
    return std::nullopt;
  return not_granted_text("realtime.lock_memory", "grant it as /usr/share/doc/locusd/examples/realtime.conf does");
}

std::optional<std::string> set_cpu_affinity(const std::vector<int>& cpus) {
  static const cpu_set_t kInitial = [] {
    cpu_set_t set;
    CPU_ZERO(&set);
    sched_getaffinity(0, sizeof(set), &set);
    return set;
  }();
  cpu_set_t set;
  CPU_ZERO(&set);
  for (const int cpu : cpus)
    CPU_SET(static_cast<std::size_t>(cpu), &set);
  if (sched_setaffinity(0, sizeof(set), cpus.empty() ? &kInitial : &set) == 0)
    return std::nullopt;
  return not_granted_text("realtime.cpus", "name processors that this machine has and the unit may use");
}

std::optional<std::string> raise_priority(int fifo_priority) {
  const sched_param wanted{fifo_priority};
  if (fifo_priority == 0 || sched_setscheduler(0, SCHED_FIFO, &wanted) == 0)
    return std::nullopt;
  return not_granted_text("realtime.priority", "grant it as /usr/share/doc/locusd/examples/realtime.conf does");
}

std::string scheduling() {
  sched_param parameters{};
  if (sched_getscheduler(0) == SCHED_FIFO && sched_getparam(0, &parameters) == 0)
    return fmt::format("real-time priority {}", parameters.sched_priority);
  std::string text = fmt::format("ordinary scheduling, nice {}", getpriority(PRIO_PROCESS, 0));
  std::string group, weight;
  std::getline(std::ifstream{"/proc/self/cgroup"}, group);
  if (group.starts_with("0::") &&
      std::getline(std::ifstream{"/sys/fs/cgroup" + group.substr(3) + "/cpu.weight"}, weight))
    text += ", CPU weight " + weight;
  return text;
}

void set_lowest_priority() {
  constexpr int kLowest = 19;
  setpriority(PRIO_PROCESS, 0, kLowest); // affects only this thread on Linux
}

} // namespace locus::daemon
