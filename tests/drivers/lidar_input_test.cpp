// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstring>
#include <functional>
#include <optional>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "drivers/lidar_router.hpp"
#include "drivers/velodyne_test_packet.hpp"
#include "support/returns.hpp"

namespace locus {
namespace {

using test::VelodyneTestPacket;
using velodyne::Model;
using velodyne::ReturnMode;

constexpr std::uint32_t kLidarIp = 0xC0A801C9;
constexpr std::uint32_t kOtherIp = 0xC0A801CA;
constexpr double kPacketUs = 1327.104;

/// The datagrams of a VLP-16 at 600 rpm by number, valid for the lifetime of the stream.
class Stream {
 public:
  explicit Stream(std::uint32_t source_ip = kLidarIp, std::uint16_t port = 2368) : ip_(source_ip), port_(port) {}

  Datagram operator()(int number, double sensor_ahead_us = 0.0) {
    const double us = kPacketUs * number;
    const auto azimuth_cdeg = static_cast<std::uint16_t>(static_cast<long>(0.36 * us) % velodyne::kCdegPerTurn);
    const auto time_of_hour_us = static_cast<std::uint32_t>(1e9 + us + sensor_ahead_us);
    packet_.emplace(Model::vlp16, ReturnMode::strongest, time_of_hour_us, azimuth_cdeg);
    packet_->set_all_returns(1000);
    return {packet_->payload(), ip_, 2368, port_,
            stamp_from_ns(1'700'000'000'000'000'000) + from_seconds(1e-6 * (us + kPacketUs + 80.0))};
  }

 private:
  std::uint32_t ip_;
  std::uint16_t port_;
  std::optional<VelodyneTestPacket> packet_;
};

LidarInput opened(const LidarOptions& options = {}) {
  auto lidar = LidarInput::open(options, 0);
  EXPECT_TRUE(lidar);
  return std::move(*lidar);
}

LidarOptions options(const char* name, std::uint16_t port, std::optional<std::uint32_t> ip = std::nullopt) {
  LidarOptions result;
  result.name = name;
  result.port = port;
  result.source_ip = ip;
  return result;
}

TEST(LidarInput, OtherSendersToItsPortAreCountedByAddress) {
  LidarInput lidar = opened();
  Stream stream;
  Stream other(kOtherIp);
  for (int i = 0; i < 100; ++i) {
    EXPECT_NE(lidar.receive(stream(i)), nullptr);
    EXPECT_EQ(lidar.receive(other(i)), nullptr);
  }
  EXPECT_EQ(lidar.sender().others()[0].ip, kOtherIp);
  EXPECT_EQ(lidar.sender().others()[0].packets, 100U);
  EXPECT_EQ(lidar.sender().others()[1].packets, 0U);
  for (std::uint32_t ip = 1; ip < 100; ++ip) // the first few of a flood suffice
    EXPECT_EQ(lidar.receive(Stream(ip)(100)), nullptr);
  EXPECT_EQ(lidar.sender().others().back().packets, 1U);
}

std::uint64_t rejected(const PacketCounters& counters) {
  std::uint64_t sum = 0;
  for (const std::uint64_t one : counters.rejected)
    sum += one;
  return sum;
}

TEST(LidarInput, GoodPacketsComeOutStampedAtTheirFirstFiring) {
  LidarInput lidar = opened();
  Stream stream;
  for (int i = 0; i < 100; ++i) {
    const Datagram datagram = stream(i);
    const LidarPacket* packet = lidar.receive(datagram);
    ASSERT_NE(packet, nullptr);
    EXPECT_EQ(test::returns_of(*packet).size(), 384U);
    EXPECT_LT(std::chrono::abs(datagram.receive_stamp - packet->stamp - packet->duration),
              std::chrono::microseconds{3});
  }
  EXPECT_EQ(lidar.counters().received, 100U);
  EXPECT_EQ(lidar.counters().data, 100U);
  EXPECT_EQ(lidar.counters().lost, 0U);
}

/// Regression: losses were counted in packets of the first pace, or not at all if the gap did not fit the rotation.
TEST(LidarInput, LostPacketsOfAVls128AreCountedAtItsPace) {
  for (const velodyne::Pace pace : {velodyne::Pace::first, velodyne::Pace::slower}) {
    LidarInput lidar = opened();
    const double packet_us = 1e6 * to_seconds(packet_duration(Model::vls128, ReturnMode::strongest, pace));
    for (int i = 0; i < 800; ++i) {
      if (i >= 50 && i < 650) // a whole turn: the speed from three columns is off by 1/40
        continue;
      const double us = packet_us * i;
      VelodyneTestPacket bytes(Model::vls128, ReturnMode::strongest, static_cast<std::uint32_t>(1e9 + us),
                               static_cast<std::uint16_t>(std::lround(0.36 * us) % velodyne::kCdegPerTurn), 600.0,
                               pace);
      bytes.set_all_returns(1000);
      const Stamp received = stamp_from_ns(1'700'000'000'000'000'000) + from_seconds(1e-6 * (us + packet_us + 80.0));
      EXPECT_NE(lidar.receive({bytes.payload(), kLidarIp, 2368, 2368, received}), nullptr) << i;
    }
    EXPECT_EQ(lidar.counters().lost, 600U);
  }
}

TEST(LidarInput, Vls128StampsAreThoseOfItsFirstFiring) {
  LidarInput lidar = opened();
  const VelodyneTestPacket bytes{Model::vls128, ReturnMode::strongest};
  const Stamp receive = stamp_from_ns(1'700'000'000'000'000'000);
  const LidarPacket* packet = lidar.receive({bytes.payload(), kLidarIp, 2368, 2368, receive});
  ASSERT_NE(packet, nullptr);
  EXPECT_EQ(packet->stamp + packet->duration, receive);
}

/// The packets of a VLP-16 whose field of view leaves a sector out: blocks within the view, twelve to a packet.
class ViewOfSector {
 public:
  ViewOfSector(double from_cdeg, double width_cdeg, double rpm = 600.0)
      : from_cdeg_(from_cdeg), width_cdeg_(width_cdeg), cdeg_per_us_(rpm / 60.0 * velodyne::kCdegPerTurn * 1e-6) {}

  void show_all() { is_restricted_ = false; }

  Datagram operator()() {
    constexpr double kBlock_us = 110.592;
    std::array<double, velodyne::kBlocks> us{};
    for (std::size_t block = 0; block < us.size(); next_us_ += kBlock_us) {
      const double in_sector_cdeg =
          std::fmod(cdeg_per_us_ * next_us_ - from_cdeg_ + velodyne::kCdegPerTurn, velodyne::kCdegPerTurn);
      if (!is_restricted_ || in_sector_cdeg >= width_cdeg_)
        us[block++] = next_us_;
    }
    packet_.emplace(Model::vlp16, ReturnMode::strongest, static_cast<std::uint32_t>(std::lround(1e9 + us[0])));
    for (std::size_t block = 0; block < us.size(); ++block)
      packet_->set_azimuth(block,
                           static_cast<std::uint16_t>(std::fmod(cdeg_per_us_ * us[block], velodyne::kCdegPerTurn)));
    packet_->set_all_returns(1000);
    return {packet_->payload(), kLidarIp, 2368, 2368,
            stamp_from_ns(1'700'000'000'000'000'000) + from_seconds(1e-6 * (next_us_ + 80.0))};
  }

 private:
  double from_cdeg_, width_cdeg_, cdeg_per_us_;
  bool is_restricted_ = true;
  double next_us_ = 0.0;
  std::optional<VelodyneTestPacket> packet_;
};

/// A field of view that is set on the lidar's page leaves sectors out; the packets that would fill them were lost.
TEST(LidarInput, UnsentSectorsAreNotLost) {
  for (const auto& [from_cdeg, width_cdeg] :
       {std::pair{9'000.0, 18'000.0}, std::pair{4'500.0, 27'000.0}, std::pair{3'000.0, 1'200.0}}) {
    LidarInput lidar = opened();
    ViewOfSector next(from_cdeg, width_cdeg);
    for (int i = 0; i < 1'500; ++i)
      EXPECT_NE(lidar.receive(next()), nullptr);
    EXPECT_EQ(lidar.counters().lost, 0U) << from_cdeg;
    for (int i = 1; i <= 1'500; ++i)
      if (const Datagram datagram = next(); i % 100 != 0)
        lidar.receive(datagram);
    EXPECT_NEAR(static_cast<double>(lidar.counters().lost), 15.0, 3.0) << from_cdeg;
    next.show_all();
    for (int i = 0; i < 3'000; ++i)
      lidar.receive(next());
    const std::uint64_t lost = lidar.counters().lost;
    for (int i = 0; i < 3; ++i)
      next();
    lidar.receive(next());
    EXPECT_EQ(lidar.counters().lost, lost + 3) << from_cdeg;
  }
}

/// Regression: the gap with which the view became known stayed lost if it was the first one between two packets.
TEST(LidarInput, UnsentSectorsAreNotLostWhereverTheyLie) {
  for (const double rpm : {300.0, 600.0, 1'200.0})
    for (const double width_cdeg : {18'000.0, 27'000.0, 28'100.0})
      for (double from_cdeg = 0.0; from_cdeg < velodyne::kCdegPerTurn; from_cdeg += 730.0) {
        LidarInput lidar = opened();
        ViewOfSector next(from_cdeg, width_cdeg, rpm);
        for (int i = 0; i < 500; ++i)
          EXPECT_NE(lidar.receive(next()), nullptr);
        EXPECT_EQ(lidar.counters().lost, 0U) << rpm << " rpm, " << width_cdeg << " from " << from_cdeg;
      }
}

TEST(LidarInput, GapOfStampAndAzimuthIsLoss) {
  LidarInput lidar = opened();
  Stream stream;
  for (const int number : {0, 1, 2, 5, 6, 106})
    lidar.receive(stream(number));
  EXPECT_EQ(lidar.counters().lost, 2U + 99U);
}

TEST(LidarInput, GapOfStampWithoutOneOfAzimuthIsNoLoss) {
  LidarInput lidar = opened();
  Stream stream;
  for (int i = 0; i < 10; ++i)
    lidar.receive(stream(i));
  for (int i = 10; i < 20; ++i)
    lidar.receive(stream(i, 15'000.0)); // the sensor's clock has advanced by 15 ms, the motor has not
  EXPECT_EQ(lidar.counters().data, 20U);
  EXPECT_EQ(lidar.counters().lost, 0U);
}

TEST(LidarInput, OvertakenPacketIsReorderedAndNotLost) {
  LidarInput lidar = opened();
  Stream stream;
  for (const int number : {0, 1, 3, 2, 4})
    EXPECT_NE(lidar.receive(stream(number)), nullptr);
  EXPECT_EQ(lidar.counters().data, 5U);
  EXPECT_EQ(lidar.counters().reordered, 1U);
  EXPECT_EQ(lidar.counters().lost, 0U);
}

TEST(LidarInput, RepeatedPacketIsADuplicate) {
  LidarInput lidar = opened();
  Stream stream;
  for (const int number : {0, 1, 1, 2, 0, 3})
    lidar.receive(stream(number));
  EXPECT_EQ(lidar.counters().data, 4U);
  EXPECT_EQ(lidar.counters()[PacketError::duplicate], 2U);
  EXPECT_EQ(lidar.counters().reordered, 0U);
}

TEST(LidarInput, FarOffTimeIsRejectedAndAClockStepCounted) {
  LidarInput lidar = opened();
  Stream stream;
  for (int i = 0; i < 10; ++i)
    lidar.receive(stream(i));
  for (int i = 10; i < 20; ++i)
    lidar.receive(stream(i, 20e6));
  EXPECT_EQ(lidar.counters()[PacketError::time], 4U);
  EXPECT_EQ(lidar.counters().clock_steps, 1U);
  EXPECT_EQ(lidar.counters().data, 16U);
  EXPECT_EQ(lidar.counters().lost, 0U);
}

/// The clock of a lidar passes the hour without wrapping, and one packet right there has a wrong time.
TEST(LidarInput, ClockBeyondTheHourCostsOnePacket) {
  LidarInput lidar = opened();
  constexpr double kPacket_us = 1327.104, kHour_us = 3.6e9;
  for (int i = 0; i < 2000; ++i) {
    const double us = kPacket_us * i;
    const double shown_us = i == 1000 ? 48e6 : kHour_us - 1000 * kPacket_us + us;
    VelodyneTestPacket bytes(Model::vlp16, ReturnMode::strongest, static_cast<std::uint32_t>(std::lround(shown_us)),
                             static_cast<std::uint16_t>(std::lround(0.36 * us) % velodyne::kCdegPerTurn));
    bytes.set_all_returns(1000);
    const Stamp received = stamp_from_ns(1'700'000'000'000'000'000) + from_seconds(1e-6 * (us + kPacket_us + 80.0));
    EXPECT_EQ(lidar.receive({bytes.payload(), kLidarIp, 2368, 2368, received}) != nullptr, i != 1000) << i;
  }
  EXPECT_EQ(lidar.counters()[PacketError::time], 1U);
  EXPECT_EQ(lidar.counters().lost, 1U);
  EXPECT_EQ(lidar.counters().clock_steps, 0U);
}

/// Position packets with a locked PPS for so long, and data packets between them. `nmea`: sentence at a time from the
/// start.
using Sentence = std::function<std::string(Duration)>;
std::string_view why_unused_after(Duration duration, const Sentence& nmea, LidarTime time = LidarTime::automatic) {
  LidarOptions options;
  options.time = time;
  LidarInput lidar = std::move(*LidarInput::open(options, 0));
  Stream stream;
  std::array<std::byte, velodyne::kPositionPacketBytes> position{};
  position[0xCA] = std::byte{2};
  const Stamp begin = stream(0).receive_stamp;
  for (int i = 0;; ++i) {
    const Datagram data = stream(i);
    lidar.receive(data);
    const std::string sentence = nmea(data.receive_stamp - begin);
    std::memcpy(&position[0xCE], sentence.data(), sentence.size());
    lidar.receive({position, kLidarIp, 8308, 8308, data.receive_stamp});
    if (data.receive_stamp - begin > duration)
      return lidar.why_pps_is_unused();
  }
}

const std::string kRmc = "$GPRMC,220243,A,3708.5809,N,12139.7813,W,028.8,158.3,111212,013.8,E,D*03\r\n";

TEST(LidarInput, UnusedLockedPpsIsReportedAfterFiveSeconds) {
  const Sentence gga = [](Duration) { return "$GPGGA,220243,3708.5809,N*00"; };
  EXPECT_EQ(why_unused_after(std::chrono::seconds{4}, gga), "");
  EXPECT_NE(why_unused_after(std::chrono::seconds{6}, gga).find("no RMC"), std::string_view::npos);
  EXPECT_EQ(why_unused_after(std::chrono::seconds{6}, gga, LidarTime::receive), "") << "configured so";
  EXPECT_EQ(why_unused_after(std::chrono::seconds{6}, [](Duration) { return kRmc; }), "");
}

/// Regression: a checksum that is right by chance, once in a few seconds, hid all wrong ones.
TEST(LidarInput, GoodSentenceAmongBadOnesDoesNotHideThem) {
  const auto is_good = [](Duration since) { return since / std::chrono::seconds{1} % 3 == 2; };
  const Sentence mostly_bad = [&](Duration since) {
    std::string sentence = kRmc;
    sentence[sentence.find('*') + 1] = is_good(since) ? '0' : '7';
    return sentence;
  };
  EXPECT_NE(why_unused_after(std::chrono::seconds{9}, mostly_bad).find("checksums"), std::string_view::npos);
  const Sentence bad_at_first = [&](Duration since) {
    return since < std::chrono::seconds{6} ? mostly_bad(Duration{}) : kRmc;
  };
  EXPECT_EQ(why_unused_after(std::chrono::seconds{12}, bad_at_first), "");
}

TEST(LidarInput, FirstSenderIsTheLidarUntilItFallsSilent) {
  LidarInput lidar = opened();
  Stream stream;
  Stream other{kOtherIp};
  EXPECT_NE(lidar.receive(stream(0)), nullptr);
  EXPECT_EQ(lidar.receive(other(1)), nullptr);
  EXPECT_NE(lidar.receive(stream(1)), nullptr);
  EXPECT_EQ(lidar.counters()[PacketError::sender], 1U);
  EXPECT_NE(lidar.receive(other(1000)), nullptr) << "1.3 s later: the lidar was replaced";
  EXPECT_EQ(lidar.sender().ip(), kOtherIp);
}

TEST(LidarInput, TruncatedDatagramOfAnyLengthIsCountedAsSuch) {
  LidarInput lidar = opened();
  Stream stream;
  Datagram datagram = stream(0);
  datagram.truncated = true;
  EXPECT_EQ(lidar.receive(datagram), nullptr);
  datagram.payload = datagram.payload.first(100);
  EXPECT_EQ(lidar.receive(datagram), nullptr);
  EXPECT_EQ(lidar.counters()[PacketError::truncated], 2U);
}

TEST(LidarInput, EveryDatagramIsCountedOnce) {
  LidarInput lidar = opened();
  Stream stream;
  std::mt19937 random{11};
  std::uniform_int_distribution<int> byte{0, 255};
  std::vector<std::byte> garbage(1500);
  int number = 0;
  for (std::size_t length = 0; length <= 1500; ++length) {
    for (std::byte& b : garbage)
      b = static_cast<std::byte>(byte(random));
    Datagram datagram = stream(number++);
    lidar.receive(datagram);
    datagram.payload = std::span{garbage}.first(length);
    lidar.receive(datagram);
  }
  const PacketCounters& counters = lidar.counters();
  EXPECT_EQ(counters.received, 2U * 1501U);
  EXPECT_EQ(counters.data, 1501U);
  EXPECT_EQ(counters.position, 1U);
  EXPECT_EQ(counters[PacketError::length], 1499U);
  EXPECT_EQ(counters.received, counters.data + counters.position + rejected(counters));
}

TEST(LidarRouter, LidarsAreDistinguishedByPort) {
  auto router = LidarRouter::open({options("front", 2368), options("rear", 2369)});
  ASSERT_TRUE(router);
  Stream front;
  Stream rear{kLidarIp, 2369};
  for (int i = 0; i < 10; ++i) {
    EXPECT_EQ(router->receive(front(i))->lidar, 0);
    EXPECT_EQ(router->receive(rear(i))->lidar, 1);
  }
  EXPECT_EQ(router->lidars()[1].counters().data, 10U);
}

TEST(LidarRouter, LidarsAreDistinguishedByAddress) {
  auto router = LidarRouter::open({options("front", 2368), options("rear", 2368, kOtherIp)});
  ASSERT_TRUE(router);
  Stream front;
  Stream rear{kOtherIp};
  for (int i = 0; i < 10; ++i) {
    EXPECT_EQ(router->receive(rear(i))->lidar, 1);
    EXPECT_EQ(router->receive(front(i))->lidar, 0);
  }
}

TEST(LidarRouter, PositionPacketsGoToTheLidarThatSendsThem) {
  auto router = LidarRouter::open({options("front", 2368), options("rear", 2368, kOtherIp)});
  ASSERT_TRUE(router);
  Stream front;
  router->receive(front(0));
  const std::array<std::byte, velodyne::kPositionPacketBytes> position{};
  EXPECT_EQ(router->receive({position, kOtherIp, 8308, 8308, Stamp{}}), nullptr);
  EXPECT_EQ(router->lidars()[0].counters().position, 0U);
  EXPECT_EQ(router->lidars()[1].counters().position, 1U);
}

TEST(LidarRouter, SendersAreKnownOnceEveryLidarOfThePortIs) {
  auto lidars = LidarRouter::open({options("front", 2368, kOtherIp), options("rear", 2368), options("top", 2400)});
  ASSERT_TRUE(lidars);
  EXPECT_EQ(lidars->senders_to(2368).count, 0U);
  Stream rear;
  ASSERT_NE(lidars->receive(rear(0)), nullptr);
  const auto senders = lidars->senders_to(2368);
  EXPECT_EQ(std::vector(senders.all().begin(), senders.all().end()), (std::vector{kOtherIp, kLidarIp}));
  EXPECT_EQ(lidars->senders_to(8308).count, 0U) << "the third may send its position packets there";
}

TEST(LidarRouter, ForeignSendersAreCounted) {
  auto router = LidarRouter::open({options("front", 2368, kLidarIp)});
  ASSERT_TRUE(router);
  Stream stranger{kOtherIp};
  Stream elsewhere{kLidarIp, 5353};
  EXPECT_EQ(router->receive(stranger(0)), nullptr);
  EXPECT_EQ(router->receive(elsewhere(0)), nullptr);
  EXPECT_EQ(router->lidars()[0].counters()[PacketError::sender], 1U);
  EXPECT_EQ(router->total()[PacketError::sender], 2U);
  EXPECT_EQ(router->total().received, 2U);
}

} // namespace
} // namespace locus
