// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "config/config.hpp"
#include "daemon/service/log.hpp"
#include "drivers/net/udp_socket.hpp"

namespace locus::daemon {

/// Returns the sockets passed by systemd (socket activation); empty if there are none. They stay open and are only
/// duplicated.
std::vector<int> inherited_sockets();

/// Returns the ports that lidars send to, each with a flag whether it is required. Ports of position packets, which
/// only carry the time, and of built-in IMUs are optional.
std::map<std::uint16_t, bool> lidar_ports(const Config& config);

/// Returns a socket for every port of lidar_ports(): the inherited ones first, then newly opened ones. Fails with one
/// line for the user.
Expected<std::vector<UdpSocket>, std::string> open_lidar_sockets(const Config& config, std::span<const int> inherited,
                                                                 Log& log);

/// Joins the multicast groups of the lidars on the interfaces that are up now.
void join_multicast(const Config& config, std::span<const UdpSocket> sockets);

/// Applies RealtimeOptions to the process; to be called before threads are created, which inherit the CPU affinity. All
/// of it is optional: returns a line for the user if a request was not granted. A default value reverts earlier calls.
std::optional<std::string> lock_memory(bool wanted);
std::optional<std::string> set_cpu_affinity(const std::vector<int>& cpus);

/// Sets the SCHED_FIFO priority of the calling thread and of threads it creates, such as TBB's workers. Returns a line
/// for the user if it was not granted.
std::optional<std::string> raise_priority(int fifo_priority);

/// Describes the scheduling policy, nice value and CPU weight in effect for the calling thread, for the log.
std::string scheduling();

/// Sets the calling thread to the lowest priority (nice 19).
void set_lowest_priority();

} // namespace locus::daemon
