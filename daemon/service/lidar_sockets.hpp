// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <vector>

#include "config/config.hpp"
#include "daemon/service/log.hpp"
#include "drivers/net/udp_socket.hpp"

namespace locus::daemon {

/// Descriptors that systemd has opened for this process (socket activation); empty without. They stay its own: sockets
/// are made from copies.
std::vector<int> inherited_sockets();

/// A socket for every port that lidars send to: their data and their position packets. Those inherited come first, the
/// others are opened. Fails with one line for the user.
Expected<std::vector<UdpSocket>, std::string> open_lidar_sockets(const Config& config, std::span<const int> inherited,
                                                                 Log& log);

/// Joins the groups of lidars that send by multicast, on the interfaces that are up by now.
void join_multicast(const Config& config, std::span<const UdpSocket> sockets);

} // namespace locus::daemon
