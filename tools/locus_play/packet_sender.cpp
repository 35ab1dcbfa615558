// SPDX-License-Identifier: Apache-2.0
#include "locus_play/packet_sender.hpp"

#include <cerrno>
#include <cstring>
#include <utility>

#include <arpa/inet.h>
#include <fmt/format.h>
#include <net/if.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include "drivers/packet_edit.hpp"
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

} // namespace

PacketSender::PacketSender(const std::string& to, std::string interface, LidarRouter lidars)
    : interface_(std::move(interface)), lidars_(std::move(lidars)) {
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
    throw Failure(ExitStatus::failed, fmt::format("a socket cannot be opened: {}", std::strerror(errno))); // NOLINT
  sockets_[source_ip] = descriptor;
  const int yes = 1;
  setsockopt(descriptor, SOL_SOCKET, SO_BROADCAST, &yes, sizeof(yes));
  ip_mreqn outgoing{};
  outgoing.imr_ifindex = static_cast<int>(if_nametoindex(interface_.c_str()));
  if (IN_MULTICAST(to_) && outgoing.imr_ifindex != 0)
    setsockopt(descriptor, IPPROTO_IP, IP_MULTICAST_IF, &outgoing, sizeof(outgoing));
  const sockaddr_in recorded = address(source_ip, 0);
  changed_sender_ |= bind(descriptor, reinterpret_cast<const sockaddr*>(&recorded), sizeof(recorded)) != 0;
  return descriptor;
}

void PacketSender::send(const Datagram& datagram, Duration shift) {
  packet_.assign(datagram.payload.begin(), datagram.payload.end());
  shift_clock(packet_, lidars_.configured_for(datagram).metadata, shift);
  const sockaddr_in to = address(to_, datagram.destination_port);
  const ssize_t sent = sendto(socket_for(datagram.source_ip), packet_.data(), packet_.size(), 0,
                              reinterpret_cast<const sockaddr*>(&to), sizeof(to));
  if (sent < 0 && errno != ECONNREFUSED) // no receiver yet; a lidar sends anyway
    throw Failure(ExitStatus::failed, fmt::format("packets cannot be sent: {}; choose another address with --to",
                                                  std::strerror(errno))); // NOLINT(concurrency-mt-unsafe)
  ++sent_;
}

} // namespace locus::tools
