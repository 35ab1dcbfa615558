// SPDX-License-Identifier: Apache-2.0
#include "locus_play/packet_sender.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <fstream>
#include <vector>

#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include "drivers/ouster/decoder.hpp"
#include "locus_sim/ouster_packet.hpp"
#include "locus_sim/ouster_sensor.hpp"
#include "support/patience.hpp"
#include "support/temporary_folder.hpp"

namespace locus::tools {
namespace {

using namespace std::chrono_literals;

/// A UDP socket of this host.
class Listener {
 public:
  Listener() : socket_(::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0)) {
    sockaddr_in own{};
    own.sin_family = AF_INET;
    own.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    socklen_t size = sizeof(own);
    bind(socket_, reinterpret_cast<const sockaddr*>(&own), size);
    getsockname(socket_, reinterpret_cast<sockaddr*>(&own), &size);
    port_ = ntohs(own.sin_port);
    const timeval patience{test::patience() / 1s, 0};
    setsockopt(socket_, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof(patience));
  }
  ~Listener() { close(socket_); }
  Listener(const Listener&) = delete;
  Listener& operator=(const Listener&) = delete;

  [[nodiscard]] std::uint16_t port() const { return port_; }
  [[nodiscard]] std::vector<std::byte> receive() const {
    std::vector<std::byte> datagram(65'536);
    const ssize_t size = recv(socket_, datagram.data(), datagram.size(), 0);
    datagram.resize(static_cast<std::size_t>(std::max<ssize_t>(size, 0)));
    return datagram;
  }

 private:
  int socket_;
  std::uint16_t port_ = 0;
};

/// Its packets exceed an Ethernet frame, and their format is known only from the metadata.
TEST(PacketSender, SendsOusterPacketsWholeWithShiftedTime) {
  const Listener listener;
  sim::SyntheticLidarOptions sensor_options;
  sensor_options.model = sim::OusterModel::os1_32;
  sensor_options.port = listener.port();
  const sim::OusterSensor sensor(sensor_options, Stamp{});
  const test::TemporaryFolder folder;
  LidarOptions options;
  options.metadata = (folder / "front.json").string();
  options.port = listener.port();
  std::ofstream{options.metadata} << sensor.metadata_text();
  auto lidars = LidarRouter::open({options});
  ASSERT_TRUE(lidars) << lidars.error();

  PacketSender sender("127.0.0.1", "lo", std::move(*lidars));
  const sim::OusterPacket packet(sensor.metadata(), 0, 1'000'000'000);
  ASSERT_GT(packet.payload().size(), 2048U);
  sender.send({.payload = packet.payload(),
               .source_ip = INADDR_LOOPBACK,
               .destination_port = listener.port(),
               .receive_stamp = Stamp{}},
              60s);
  ouster::Decoder decoder(sensor.metadata());
  LidarPacket decoded;
  ASSERT_EQ(decoder.decode(listener.receive(), decoded), std::nullopt);
  EXPECT_EQ(decoder.time(), 61s);
  EXPECT_TRUE(decoder.has_checksums());
}

} // namespace
} // namespace locus::tools
