// SPDX-License-Identifier: Apache-2.0
#include "drivers/net/udp_socket.hpp"

#include <gtest/gtest.h>

#include <ctime>
#include <fstream>
#include <stdexcept>
#include <utility>
#include <vector>

#include <fcntl.h>

#include "support/kernel_stamps.hpp"
#include "support/temporary_file.hpp"
#include "support/udp_sender.hpp"

namespace locus {
namespace {

using test::UdpSender;

constexpr std::uint16_t kAnyPort = 0; ///< chosen by the kernel

UdpSocket open_any() {
  auto socket = UdpSocket::open(kAnyPort);
  if (!socket)
    throw std::runtime_error(socket.error());
  return std::move(*socket);
}

Stamp now() {
  timespec t{};
  clock_gettime(CLOCK_REALTIME, &t);
  return Stamp{std::chrono::seconds{t.tv_sec} + Duration{t.tv_nsec}};
}

TEST(UdpSocket, GivesPayloadSenderPortAndTheKernelsStamp) {
  const test::KernelStamps stamps;
  UdpSocket socket = open_any();
  const UdpSender sender;
  const Stamp before = now();
  sender.send(socket.port(), test::bytes_of("first"));
  sender.send(socket.port(), test::bytes_of("second"));
  const Stamp after = now();
  const auto datagrams = socket.receive();
  ASSERT_EQ(datagrams.size(), 2U);
  EXPECT_EQ(std::vector(datagrams[1].payload.begin(), datagrams[1].payload.end()), test::bytes_of("second"));
  EXPECT_EQ(datagrams[0].source_ip, INADDR_LOOPBACK);
  EXPECT_NE(datagrams[0].source_port, 0);
  EXPECT_EQ(datagrams[0].destination_port, socket.port());
  EXPECT_FALSE(datagrams[0].truncated);
  EXPECT_GE(datagrams[0].receive_stamp, before);
  EXPECT_LE(datagrams[0].receive_stamp, datagrams[1].receive_stamp);
  EXPECT_LE(datagrams[1].receive_stamp, after) << "the kernel's, not that of the look";
  EXPECT_TRUE(socket.receive().empty());
}

TEST(UdpSocket, LongDatagramIsMarkedTruncated) {
  UdpSocket socket = open_any();
  UdpSender().send(socket.port(), std::vector<std::byte>(kLongestPayload + 1));
  const auto datagrams = socket.receive();
  ASSERT_EQ(datagrams.size(), 1U);
  EXPECT_TRUE(datagrams[0].truncated);
}

TEST(UdpSocket, CountsKernelDrops) {
  UdpSocket socket = open_any();
  const UdpSender sender;
  const std::vector<std::byte> packet(1206);
  const std::size_t flood = 2 * static_cast<std::size_t>(socket.buffer_bytes()) / packet.size() + 1000;
  for (std::size_t i = 0; i < flood; ++i)
    sender.send(socket.port(), packet);
  std::size_t received = 0;
  for (std::size_t batch = 1; batch > 0; received += batch)
    batch = socket.receive().size();
  sender.send(socket.port(), packet); // carries the drop counter
  received += socket.receive().size();
  EXPECT_GT(socket.kernel_drops(), 0U);
  EXPECT_EQ(received + socket.kernel_drops(), flood + 1);
}

TEST(UdpSocket, ReceivesFromJoinedGroups) {
  constexpr std::uint32_t kGroup = 0xEF01'0203; // 239.1.2.3
  UdpSocket socket = open_any();
  ASSERT_TRUE(socket.join(kGroup));
  EXPECT_TRUE(socket.join(kGroup)) << "and may be told again";
  UdpSender().send(socket.port(), test::bytes_of("to all of us"), kGroup);
  EXPECT_EQ(socket.receive().size(), 1U);
}

TEST(UdpSocket, PortInUseIsReported) {
  const UdpSocket first = open_any();
  const auto second = UdpSocket::open(first.port());
  ASSERT_FALSE(second);
  EXPECT_NE(second.error().find("another program listens there"), std::string::npos) << second.error();
}

/// Two instances of the service receive the position packets of broadcasting lidars like this.
TEST(UdpSocket, SharedSocketsBothReceiveABroadcast) {
  constexpr std::uint32_t kEverybody = 0x7FFF'FFFF; // 127.255.255.255
  auto first = UdpSocket::open_shared(0);
  ASSERT_TRUE(first) << first.error();
  auto second = UdpSocket::open_shared(first->port());
  ASSERT_TRUE(second) << second.error();
  EXPECT_FALSE(UdpSocket::open(first->port())) << "who wants it alone is not let in";
  UdpSender().send(first->port(), test::bytes_of("to everybody"), kEverybody);
  EXPECT_EQ(first->receive().size(), 1U);
  EXPECT_EQ(second->receive().size(), 1U);
}

TEST(UdpSocket, TakesOverWhatIsBoundToBothFamilies) {
  const int both = ::socket(AF_INET6, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  sockaddr_in6 any{};
  any.sin6_family = AF_INET6;
  ASSERT_EQ(bind(both, reinterpret_cast<const sockaddr*>(&any), sizeof(any)), 0);
  auto socket = UdpSocket::adopt(both);
  ASSERT_TRUE(socket) << socket.error();
  UdpSender().send(socket->port(), test::bytes_of("mapped"));
  const auto datagrams = socket->receive();
  ASSERT_EQ(datagrams.size(), 1U);
  EXPECT_EQ(datagrams[0].source_ip, INADDR_LOOPBACK);
}

TEST(UdpSocket, DropsBeforeTheTakeOverAreNotCounted) {
  UdpSocket first = open_any();
  const int again = dup(first.descriptor());
  const UdpSender sender;
  const std::vector<std::byte> packet(1206);
  for (std::size_t i = 0; i < 2 * static_cast<std::size_t>(first.buffer_bytes()) / packet.size() + 1000; ++i)
    sender.send(first.port(), packet);
  while (!first.receive().empty()) {
  }
  ASSERT_GT(first.kernel_drops(), 0U);
  auto second = UdpSocket::adopt(again);
  ASSERT_TRUE(second) << second.error();
  sender.send(second->port(), packet);
  EXPECT_EQ(second->receive().size(), 1U);
  EXPECT_EQ(second->kernel_drops(), 0U);
}

/// Sockets as bound by systemd for a socket unit: without an exclusive bind, the last one to bind receives everything.
TEST(UdpSocket, PortTakenOverIsSharedWithNobody) {
  const auto bind_again = [](std::uint16_t port) {
    const int descriptor = ::socket(AF_INET, SOCK_DGRAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
    const int yes = 1;
    EXPECT_EQ(setsockopt(descriptor, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof(yes)), 0);
    const sockaddr_in address{AF_INET, htons(port), {htonl(INADDR_ANY)}, {}};
    if (bind(descriptor, reinterpret_cast<const sockaddr*>(&address), sizeof(address)) == 0)
      return descriptor;
    close(descriptor);
    return -1;
  };
  const auto owned = UdpSocket::adopt(bind_again(kAnyPort));
  ASSERT_TRUE(owned) << owned.error();
  EXPECT_EQ(bind_again(owned->port()), -1);
}

TEST(UdpSocket, TakesOverALargerBufferAsItIs) {
  const int large = ::socket(AF_INET, SOCK_DGRAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
  const int wanted = 4 * UdpSocket::kWantedBufferBytes;
  if (setsockopt(large, SOL_SOCKET, SO_RCVBUFFORCE, &wanted, sizeof(wanted)) != 0)
    GTEST_SKIP() << "only root gives a socket more than others";
  const sockaddr_in address{AF_INET, kAnyPort, {htonl(INADDR_LOOPBACK)}, {}};
  ASSERT_EQ(bind(large, reinterpret_cast<const sockaddr*>(&address), sizeof(address)), 0);
  const auto socket = UdpSocket::adopt(large);
  ASSERT_TRUE(socket) << socket.error();
  EXPECT_EQ(socket->buffer_bytes(), wanted);
}

/// Privileged processes get the requested size, others at most the limit of the kernel.
TEST(UdpSocket, ReportsItsBufferSize) {
  int allowed = 0;
  std::ifstream("/proc/sys/net/core/rmem_max") >> allowed;
  if (allowed == 0)
    GTEST_SKIP() << "this container does not say what the kernel allows";
  const int given = open_any().buffer_bytes();
  EXPECT_TRUE(given == UdpSocket::kWantedBufferBytes || given == allowed) << given;
}

TEST(UdpSocket, TakesOverNothingElse) {
  EXPECT_FALSE(UdpSocket::adopt(open("/dev/null", O_RDONLY | O_CLOEXEC)));
  EXPECT_FALSE(UdpSocket::adopt(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)));
}

} // namespace
} // namespace locus
