// SPDX-License-Identifier: Apache-2.0
#include "drivers/net/flood_guard.hpp"

#include <gtest/gtest.h>

#include <stdexcept>
#include <utility>
#include <vector>

#include <fcntl.h>

#include "support/udp_sender.hpp"

namespace locus {
namespace {

using std::chrono::milliseconds;

constexpr std::uint32_t kStranger = INADDR_LOOPBACK + 1;

LidarRouter::Senders senders(std::uint32_t ip) { return {{ip}, 1}; }

class Guarded : public testing::Test {
 protected:
  /// Feeds this many datagrams, all received at the current time.
  void look_at(std::uint64_t count, std::size_t bytes, std::uint32_t ip) {
    const std::vector<std::byte> payload(bytes);
    Datagram datagram{payload, ip, 2368, socket_.port(), now_};
    for (std::uint64_t i = 0; i < count; ++i)
      guard_.look_at({&datagram, 1}, socket_);
  }
  void seconds_later() { now_ += milliseconds{1500}; }

  /// Sends a thousand datagrams from the loopback address; returns the number received.
  std::size_t passing(std::size_t bytes) {
    const std::vector<std::byte> payload(bytes);
    std::size_t received = 0;
    for (int i = 0; i < 1000; ++i) {
      sender_.send(socket_.port(), payload);
      if (i % 50 == 49)
        for (auto batch = socket_.receive(); !batch.empty(); batch = socket_.receive())
          received += batch.size();
    }
    return received;
  }

  UdpSocket socket_ = [] {
    auto socket = UdpSocket::open(0);
    return socket ? std::move(*socket) : throw std::runtime_error(socket.error());
  }();
  test::UdpSender sender_;
  FloodGuard guard_;
  Stamp now_ = stamp_from_ns(1'700'000'000'000'000'000);
};

TEST_F(Guarded, TrafficBelowAFloodIsPassed) {
  look_at(FloodGuard::kFlood, 700, INADDR_LOOPBACK);
  EXPECT_EQ(passing(700), 1000U);
  EXPECT_EQ(socket_.filtered(), 0U);
}

TEST_F(Guarded, FloodOfAWrongLengthIsFilteredExceptSamplesAndLidars) {
  look_at(FloodGuard::kFlood + 1, 700, kStranger);
  for (const std::size_t bytes : {0U, 1U, 511U, 513U, 1205U, 1207U, 3000U}) {
    const std::uint64_t before = socket_.filtered();
    const std::size_t passed = passing(bytes);
    EXPECT_LT(passed, 30U) << bytes << " bytes: about four are let through to be looked at";
    passing(velodyne::kDataPacketBytes);
    EXPECT_EQ(socket_.filtered() - before + passed, 1000U) << bytes << " bytes: each is counted";
  }
  EXPECT_EQ(passing(velodyne::kDataPacketBytes), 1000U);
  EXPECT_EQ(passing(velodyne::kPositionPacketBytes), 1000U);
  EXPECT_EQ(socket_.kernel_drops(), 0U);
}

TEST_F(Guarded, FloodOfAForeignSenderIsFilteredOnceTheLidarIsKnown) {
  guard_.expect(senders(kStranger), socket_);
  look_at(FloodGuard::kFlood + 1, velodyne::kDataPacketBytes, INADDR_LOOPBACK);
  EXPECT_LT(passing(velodyne::kDataPacketBytes), 30U);
  guard_.expect(senders(INADDR_LOOPBACK), socket_); // the lidar has another address now
  EXPECT_EQ(passing(velodyne::kDataPacketBytes), 1000U);
  guard_.expect(senders(kStranger), socket_);
  EXPECT_LT(passing(velodyne::kDataPacketBytes), 30U);
  guard_.expect({}, socket_);
  EXPECT_EQ(passing(velodyne::kDataPacketBytes), 1000U) << "while one lidar is not known anybody may be it";
  LidarRouter::Senders many{{}, LidarRouter::Senders::kMax};
  many.ips.back() = INADDR_LOOPBACK;
  guard_.expect(many, socket_);
  EXPECT_EQ(passing(velodyne::kPositionPacketBytes), 1000U) << "the last of many";
  many.ips.back() = kStranger;
  guard_.expect(many, socket_);
  EXPECT_LT(passing(velodyne::kPositionPacketBytes), 30U);
}

TEST_F(Guarded, FastLidarIsNoFlood) {
  guard_.expect(senders(INADDR_LOOPBACK), socket_);
  look_at(20 * FloodGuard::kFlood, velodyne::kDataPacketBytes, INADDR_LOOPBACK);
  EXPECT_EQ(passing(700), 1000U);
}

TEST_F(Guarded, EndOfTheFloodOpensTheSocketAgain) {
  look_at(FloodGuard::kFlood + 1, 700, kStranger);
  seconds_later();
  look_at(FloodGuard::kFlood / FloodGuard::kSample + 1, 700, kStranger); // the samples of an ongoing flood
  seconds_later();
  look_at(1, 700, kStranger);
  EXPECT_LT(passing(700), 30U);
  seconds_later();
  look_at(1, velodyne::kDataPacketBytes, kStranger);
  EXPECT_EQ(passing(700), 1000U);
}

/// A few later datagrams are no flood, and must not be reported as one.
TEST_F(Guarded, EndOfTheFloodIsDetectedInSilence) {
  look_at(FloodGuard::kFlood + 1, 700, kStranger);
  guard_.advance(now_ += milliseconds{900}, socket_);
  EXPECT_LT(passing(700), 30U) << "the second is not over";
  for (int second = 0; second < 2; ++second) // the previous count expires with the first
    guard_.advance(now_ += milliseconds{1100}, socket_);
  EXPECT_EQ(passing(700), 1000U);
}

TEST_F(Guarded, SocketThatIsTakenOverHasNoFilterOfAnotherOwner) {
  look_at(FloodGuard::kFlood + 1, 700, kStranger);
  ASSERT_LT(passing(700), 30U);
  auto adopted = UdpSocket::adopt(fcntl(socket_.descriptor(), F_DUPFD_CLOEXEC, 0));
  ASSERT_TRUE(adopted) << adopted.error();
  EXPECT_EQ(passing(700), 1000U);
}

} // namespace
} // namespace locus
