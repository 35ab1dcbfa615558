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

/// Descriptors that systemd has opened for this process (socket activation); empty without. They stay its own: sockets
/// are made from copies.
std::vector<int> inherited_sockets();

/// The ports that lidars send to, each with whether the service is of no use without it: position packets tell the
/// time, and are missed by nobody else.
std::map<std::uint16_t, bool> lidar_ports(const Config& config);

/// A socket for every port that lidars send to: their data and their position packets. Those inherited come first, the
/// others are opened. Fails with one line for the user.
Expected<std::vector<UdpSocket>, std::string> open_lidar_sockets(const Config& config, std::span<const int> inherited,
                                                                 Log& log);

/// Joins the groups of lidars that send by multicast, on the interfaces that are up by now.
void join_multicast(const Config& config, std::span<const UdpSocket> sockets);

/// Gives the process what RealtimeOptions ask of the operating system; to be called before the threads are made, for
/// they inherit processors. Nothing is needed for the service to work: a line for the user for each wish that was not
/// granted. Without a wish, what an earlier call has done is undone.
std::optional<std::string> lock_memory(bool wanted);
std::optional<std::string> keep_to_cpus(const std::vector<int>& cpus);

/// Of the calling thread, and of those that it will make: TBB's helpers have the priority of the thread they help.
std::optional<std::string> raise_priority(int fifo_priority);

/// What is in force of it, and of what the service's unit gives, for the calling thread. For a line of the log.
std::string scheduling();

/// Of the calling thread: it waits for all others.
void take_least_priority();

} // namespace locus::daemon
