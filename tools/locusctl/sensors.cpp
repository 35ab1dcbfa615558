// SPDX-License-Identifier: Apache-2.0
#include "locusctl/sensors.hpp"

#include <array>
#include <cerrno>
#include <cstring>
#include <ctime>
#include <map>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include <arpa/inet.h>
#include <fmt/format.h>
#include <net/ethernet.h>
#include <netpacket/packet.h>
#include <pcap/dlt.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include "daemon/machine_time.hpp"
#include "drivers/files/udp_frame.hpp"
#include "drivers/lidar_input.hpp"
#include "drivers/net/datagram.hpp"
#include "drivers/net/udp_socket.hpp"
#include "locus_replay/failure.hpp"

namespace locus::tools {
namespace {

/// Where datagrams are overheard. One owner.
class Wire {
 public:
  Wire() : raw_(::socket(AF_PACKET, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, htons(ETH_P_IP))) {
    if (raw_ >= 0)
      return;
    for (const std::uint16_t port : {kDefaultDataPort, kDefaultPositionPort})
      if (auto socket = UdpSocket::open(port))
        sockets_.push_back(std::move(*socket));
    if (sockets_.empty())
      throw Failure(ExitStatus::failed,
                    "no permission to capture packets, and the lidar ports are in use; run as root");
  }
  ~Wire() {
    if (raw_ >= 0)
      close(raw_);
  }
  Wire(const Wire&) = delete;
  Wire& operator=(const Wire&) = delete;

  template <class Take> void listen(Duration timeout, const Take& take) {
    std::vector<pollfd> poll;
    if (raw_ >= 0)
      poll.push_back({raw_, POLLIN, 0});
    for (const UdpSocket& socket : sockets_)
      poll.push_back({socket.descriptor(), POLLIN, 0});
    const timespec wait = daemon::to_timespec(timeout);
    ppoll(poll.data(), poll.size(), &wait, nullptr);
    for (UdpSocket& socket : sockets_)
      for (const Datagram& datagram : socket.receive())
        take(datagram);
    while (raw_ >= 0) {
      sockaddr_ll from{};
      socklen_t size = sizeof(from);
      const ssize_t bytes =
          recvfrom(raw_, frame_.data(), frame_.size(), MSG_TRUNC, reinterpret_cast<sockaddr*>(&from), &size);
      if (bytes <= 0)
        return;
      if (from.sll_pkttype == PACKET_OUTGOING)
        continue; // seen again as it comes in, on the loopback interface
      const auto length = static_cast<std::size_t>(bytes);
      if (auto datagram = udp_datagram(DLT_RAW, {frame_.data(), std::min(length, frame_.size())}, length)) {
        datagram->receive_stamp = Stamp{daemon::read_clock(CLOCK_REALTIME)};
        take(*datagram);
      }
    }
  }

 private:
  int raw_;
  std::vector<UdpSocket> sockets_; ///< only where raw_ is not permitted
  std::array<std::byte, 4096> frame_{};
};

/// What was heard from one address on one port.
struct Heard {
  velodyne::Decoder decoder;
  LidarPacket packet;
  std::uint64_t data = 0, refused = 0;
  Stamp first, last;
};

using Key = std::pair<std::uint32_t, std::uint16_t>; ///< address and port

std::string describe(const Key& key, const Heard& heard, std::optional<velodyne::PositionPacket> position) {
  const double seconds = std::max(1e-3, to_seconds(heard.last - heard.first));
  return fmt::format("{:<16}{:<7}{:<12}{:>5.0f} rpm  {:<10}{:>7.0f} packets/s  PPS {}\n", dotted(key.first), key.second,
                     velodyne::to_string(*heard.decoder.model()), heard.decoder.rotation_rate_rpm(),
                     velodyne::to_string(*heard.decoder.return_mode()), static_cast<double>(heard.data - 1) / seconds,
                     position ? to_string(position->pps) : "unknown");
}

} // namespace

std::string find_sensors(Duration duration) {
  Wire wire;
  std::map<Key, std::unique_ptr<Heard>> lidars;
  std::map<std::uint32_t, velodyne::PositionPacket> positions;
  const auto take = [&](const Datagram& datagram) {
    if (datagram.payload.size() == velodyne::kPositionPacketBytes)
      positions[datagram.source_ip] =
          velodyne::parse_position_packet(datagram.payload.first<velodyne::kPositionPacketBytes>());
    if (datagram.payload.size() != velodyne::kDataPacketBytes)
      return;
    auto& heard = lidars[{datagram.source_ip, datagram.destination_port}];
    if (!heard)
      heard = std::make_unique<Heard>();
    if (heard->decoder.decode(datagram.payload, heard->packet)) {
      ++heard->refused;
      return;
    }
    heard->first = heard->data++ == 0 ? datagram.receive_stamp : heard->first;
    heard->last = datagram.receive_stamp;
  };
  const Duration end = daemon::read_clock(CLOCK_MONOTONIC) + duration;
  for (Duration now{}; (now = daemon::read_clock(CLOCK_MONOTONIC)) < end;)
    wire.listen(end - now, take);

  std::string text, refused, yaml;
  std::map<std::uint16_t, int> on_port;
  for (const auto& [key, heard] : lidars)
    on_port[key.second] += heard->data > 0 ? 1 : 0;
  for (const auto& [key, heard] : lidars) {
    if (const auto unknown = heard->decoder.unknown_packets())
      refused += fmt::format("{:<16}{:<7}not read: {}\n", dotted(key.first), key.second, to_string(*unknown));
    if (heard->data == 0)
      continue;
    const auto position = positions.find(key.first);
    text += describe(key, *heard, position != positions.end() ? std::optional{position->second} : std::nullopt);
    yaml += fmt::format("  - {{name: lidar{}, model: {}, port: {}{}, T_base_lidar: {{xyz_m: [0, 0, 0], rpy_deg: [0, 0, "
                        "0]}}}}\n",
                        1 + std::count(yaml.begin(), yaml.end(), '\n'), velodyne::to_string(*heard->decoder.model()),
                        key.second, on_port[key.second] > 1 ? ", source_ip: " + dotted(key.first) : "");
  }
  if (text.empty())
    throw Failure(ExitStatus::failed,
                  fmt::format("{}no lidar was heard within {:.0f} s; look at power, cable and the address it sends to",
                              refused, to_seconds(duration)));
  return text + refused + "\nlidars:\n" + yaml;
}

} // namespace locus::tools
