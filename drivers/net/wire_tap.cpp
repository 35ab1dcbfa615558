// SPDX-License-Identifier: Apache-2.0
#include "drivers/net/wire_tap.hpp"

#include <algorithm>
#include <chrono>
#include <utility>

#include <arpa/inet.h>
#include <net/ethernet.h>
#include <netpacket/packet.h>
#include <pcap/dlt.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include "drivers/files/udp_frame.hpp"

namespace locus {
Expected<WireTap, std::string> WireTap::open(std::span<const std::uint16_t> ports) {
  if (const int frames = ::socket(AF_PACKET, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, htons(ETH_P_IP)); frames >= 0)
    return WireTap{frames, {}};
  std::vector<UdpSocket> sockets;
  for (const std::uint16_t port : ports)
    if (auto socket = UdpSocket::open(port))
      sockets.push_back(std::move(*socket));
  if (sockets.empty())
    return std::string{"no permission to capture packets, and the lidar ports are in use; run as root"};
  return WireTap{-1, std::move(sockets)};
}

WireTap::~WireTap() {
  if (frames_ >= 0)
    close(frames_);
}

WireTap::WireTap(WireTap&& other) noexcept
    : frames_(std::exchange(other.frames_, -1)), sockets_(std::move(other.sockets_)),
      fragments_(std::move(other.fragments_)) {}

void WireTap::listen(Duration duration, const Receiver& receive) {
  const auto end = std::chrono::steady_clock::now() + duration;
  for (auto now = end - duration; now < end; now = std::chrono::steady_clock::now()) {
    wait(end - now);
    for (UdpSocket& socket : sockets_)
      for (const Datagram& datagram : socket.receive())
        receive(datagram);
    read_frames(receive);
  }
}

void WireTap::wait(Duration timeout) const {
  std::vector<pollfd> poll;
  if (frames_ >= 0)
    poll.push_back({frames_, POLLIN, 0});
  for (const UdpSocket& socket : sockets_)
    poll.push_back({socket.descriptor(), POLLIN, 0});
  const auto ms = std::chrono::ceil<std::chrono::milliseconds>(timeout).count();
  ::poll(poll.data(), poll.size(), static_cast<int>(std::min<std::int64_t>(ms, 100)));
}

/// Reads the pending frames, at most kBatch, so that listen() ends on time even in a flood.
void WireTap::read_frames(const Receiver& receive) {
  constexpr int kBatch = 1024;
  for (int frames = 0; frames_ >= 0 && frames < kBatch; ++frames) {
    sockaddr_ll from{};
    socklen_t size = sizeof(from);
    const ssize_t bytes =
        recvfrom(frames_, frame_.data(), frame_.size(), MSG_TRUNC, reinterpret_cast<sockaddr*>(&from), &size);
    if (bytes <= 0)
      return;
    if (from.sll_pkttype == PACKET_OUTGOING)
      continue; // received again on the loopback interface
    const auto length = static_cast<std::size_t>(bytes);
    const std::span<const std::byte> frame{frame_.data(), std::min(length, frame_.size())};
    std::optional<Datagram> datagram;
    if (const auto whole = udp_datagram(DLT_RAW, frame, length))
      datagram = *whole;
    else if (whole.error() == FrameError::fragment)
      datagram = fragments_.add(DLT_RAW, frame);
    if (datagram) {
      datagram->receive_stamp = Stamp{std::chrono::system_clock::now().time_since_epoch()};
      receive(*datagram);
    }
  }
}

} // namespace locus
