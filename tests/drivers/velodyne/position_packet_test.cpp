// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <array>
#include <cstring>
#include <random>
#include <string>

#include "drivers/velodyne/position_packet.hpp"

namespace locus::velodyne {
namespace {

const std::string kSentence = "$GPRMC,220243,A,3708.5809,N,12139.7813,W,028.8,158.3,111212,013.8,E,D*03\r\n";

TEST(PositionPacket, RmcSentenceIsRead) {
  const auto rmc = parse_rmc(kSentence);
  ASSERT_TRUE(rmc);
  EXPECT_TRUE(rmc->valid);
  EXPECT_EQ(rmc->time_of_day, std::chrono::hours{22} + std::chrono::minutes{2} + std::chrono::seconds{43});
  using namespace std::chrono;
  EXPECT_EQ(rmc->date, (2012y / December / 11d));
  EXPECT_NEAR(rmc->speed_mps.value(), 28.8 * 1852.0 / 3600.0, 1e-9);
  EXPECT_NEAR(rmc->course_deg.value(), 158.3, 1e-9);
}

TEST(PositionPacket, ReceiverWithoutFixHasTimeButNoSpeed) {
  const auto rmc = parse_rmc("$GPRMC,081802.25,V,,,,,,,210116,,,N*7C");
  ASSERT_TRUE(rmc);
  EXPECT_FALSE(rmc->valid);
  EXPECT_EQ(rmc->time_of_day % std::chrono::minutes{1}, std::chrono::milliseconds{2250});
  EXPECT_EQ(rmc->speed_mps, std::nullopt);
  EXPECT_EQ(rmc->course_deg, std::nullopt);
}

TEST(PositionPacket, EveryChangedCharacterIsNoticed) {
  for (std::size_t i = 0; i < kSentence.find('\r'); ++i) {
    std::string changed = kSentence;
    changed[i] = changed[i] == '7' ? '8' : '7';
    EXPECT_EQ(parse_rmc(changed), std::nullopt) << changed;
  }
}

TEST(PositionPacket, EveryBeginningOfASentenceIsNone) {
  for (std::size_t length = 0; length < kSentence.find('\r'); ++length)
    EXPECT_EQ(parse_rmc(kSentence.substr(0, length)), std::nullopt);
}

TEST(PositionPacket, OtherSentencesAreNone) {
  EXPECT_EQ(parse_rmc("$GPGGA,220243,3708.5809,N*00"), std::nullopt);
  EXPECT_EQ(parse_rmc("$*00"), std::nullopt);
  EXPECT_EQ(parse_rmc(""), std::nullopt);
}

std::array<std::byte, kPositionPacketBytes> packet(std::uint8_t pps, const std::string& nmea) {
  std::array<std::byte, kPositionPacketBytes> bytes{};
  bytes[0xC6] = std::byte{0x10};
  bytes[0xC9] = std::byte{0x20};
  bytes[0xCA] = std::byte{pps};
  std::memcpy(&bytes[0xCE], nmea.data(), nmea.size());
  return bytes;
}

TEST(PositionPacket, SynchronisedMeansPpsLockedAndAValidFix) {
  EXPECT_TRUE(parse_position_packet(packet(2, kSentence)).is_synchronised());
  EXPECT_FALSE(parse_position_packet(packet(1, kSentence)).is_synchronised());
  EXPECT_FALSE(parse_position_packet(packet(2, "")).is_synchronised());
  EXPECT_FALSE(parse_position_packet(packet(2, "$GPRMC,081802.25,V,,,,,,,210116,,,N*7C")).is_synchronised());
  EXPECT_EQ(parse_position_packet(packet(200, "")).pps, PpsState::error);
  EXPECT_EQ(parse_position_packet(packet(0, "")).time_of_hour, std::chrono::microseconds{0x20000010});
}

TEST(PositionPacket, RandomBytesSayNothing) {
  std::mt19937 random{3};
  std::uniform_int_distribution<int> byte{0, 255};
  std::array<std::byte, kPositionPacketBytes> bytes;
  for (int i = 0; i < 5'000; ++i) {
    for (std::byte& b : bytes)
      b = static_cast<std::byte>(byte(random));
    std::memcpy(&bytes[0xCE], "$GPRMC,", 7);
    EXPECT_EQ(parse_position_packet(bytes).rmc, std::nullopt);
  }
}

} // namespace
} // namespace locus::velodyne
