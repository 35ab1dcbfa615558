// SPDX-License-Identifier: Apache-2.0
#include "locus_play/packet_sender.hpp"

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <utility>

#include <arpa/inet.h>
#include <fmt/format.h>
#include <net/if.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include "drivers/velodyne/model.hpp"
#include "drivers/velodyne/position_packet.hpp"
#include "drivers/velodyne/wire.hpp"
#include "locus_replay/failure.hpp"

namespace locus::tools {
namespace {

sockaddr_in address(std::uint32_t ip, std::uint16_t port) {
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(ip);
  address.sin_port = htons(port);
  return address;
}

/// Where a packet of this length has its time of hour; nothing for others.
std::size_t time_offset(std::size_t bytes) {
  if (bytes == velodyne::kDataPacketBytes)
    return velodyne::kTimeOffset;
  return bytes == velodyne::kPositionPacketBytes ? velodyne::kTimeOfHourOffset : 0;
}

void shift_clock(std::span<std::byte> packet, Duration shift) {
  constexpr std::int64_t kHour_us = 3'600'000'000;
  const std::size_t offset = time_offset(packet.size());
  if (offset == 0)
    return;
  const std::int64_t now_us = read_u32(packet.data() + offset);
  if (now_us >= kHour_us)
    return; // no time at all; the receiver is to see that
  const std::int64_t shifted_us = ((now_us + shift.count() / 1000) % kHour_us + kHour_us) % kHour_us;
  for (std::size_t i = 0; i < 4; ++i)
    packet[offset + i] = static_cast<std::byte>(shifted_us >> 8 * i & 0xFF);
}

} // namespace

PacketSender::PacketSender(const std::string& to, std::string interface) : interface_(std::move(interface)) {
  in_addr parsed{};
  inet_pton(AF_INET, to.c_str(), &parsed);
  to_ = ntohl(parsed.s_addr);
}

PacketSender::~PacketSender() {
  for (const auto& [ip, descriptor] : sockets_)
    close(descriptor);
}

int PacketSender::socket_for(std::uint32_t source_ip) {
  if (const auto found = sockets_.find(source_ip); found != sockets_.end())
    return found->second;
  const int descriptor = ::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  if (descriptor < 0)
    throw Failure(ExitStatus::failed, fmt::format("no socket: {}", std::strerror(errno))); // NOLINT
  sockets_[source_ip] = descriptor;
  const int yes = 1;
  setsockopt(descriptor, SOL_SOCKET, SO_BROADCAST, &yes, sizeof(yes));
  ip_mreqn leave_by{};
  leave_by.imr_ifindex = static_cast<int>(if_nametoindex(interface_.c_str()));
  if (IN_MULTICAST(to_) && leave_by.imr_ifindex != 0)
    setsockopt(descriptor, IPPROTO_IP, IP_MULTICAST_IF, &leave_by, sizeof(leave_by));
  const sockaddr_in recorded = address(source_ip, 0);
  changed_sender_ |= bind(descriptor, reinterpret_cast<const sockaddr*>(&recorded), sizeof(recorded)) != 0;
  return descriptor;
}

void PacketSender::send(const Datagram& datagram, Duration shift) {
  const std::size_t size = std::min(datagram.payload.size(), buffer_.size());
  std::copy_n(datagram.payload.begin(), size, buffer_.begin());
  shift_clock({buffer_.data(), size}, shift);
  const sockaddr_in to = address(to_, datagram.destination_port);
  const ssize_t sent = sendto(socket_for(datagram.source_ip), buffer_.data(), size, 0,
                              reinterpret_cast<const sockaddr*>(&to), sizeof(to));
  if (sent < 0 && errno != ECONNREFUSED) // nobody listens yet; a lidar does not mind
    throw Failure(ExitStatus::failed, fmt::format("packets cannot be sent: {}; choose another address with --to",
                                                  std::strerror(errno))); // NOLINT(concurrency-mt-unsafe)
  ++sent_;
}

} // namespace locus::tools
