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
  const auto rmc = parse_nmea(kSentence).rmc;
  ASSERT_TRUE(rmc);
  EXPECT_TRUE(rmc->valid);
  EXPECT_EQ(rmc->time_of_day, std::chrono::hours{22} + std::chrono::minutes{2} + std::chrono::seconds{43});
  using namespace std::chrono;
  EXPECT_EQ(rmc->date, (2012y / December / 11d));
  EXPECT_NEAR(rmc->speed_mps.value(), 28.8 * 1852.0 / 3600.0, 1e-9);
  EXPECT_NEAR(rmc->course_deg.value(), 158.3, 1e-9);
}

TEST(PositionPacket, ReceiverWithoutFixHasTimeButNoSpeed) {
  const auto rmc = parse_nmea("$GPRMC,081802.25,V,,,,,,,210116,,,N*7C").rmc;
  ASSERT_TRUE(rmc);
  EXPECT_FALSE(rmc->valid);
  EXPECT_EQ(rmc->time_of_day % std::chrono::minutes{1}, std::chrono::milliseconds{2250});
  EXPECT_EQ(rmc->speed_mps, std::nullopt);
  EXPECT_EQ(rmc->course_deg, std::nullopt);
}

TEST(PositionPacket, EveryChangedCharacterIsDetected) {
  for (std::size_t i = 0; i < kSentence.find('\r'); ++i) {
    std::string changed = kSentence;
    changed[i] = changed[i] == '7' ? '8' : '7';
    EXPECT_EQ(parse_nmea(changed).rmc, std::nullopt) << changed;
  }
}

TEST(PositionPacket, TruncatedSentencesAreRejected) {
  for (std::size_t length = 0; length < kSentence.find('\r'); ++length)
    EXPECT_EQ(parse_nmea(kSentence.substr(0, length)).rmc, std::nullopt);
}

TEST(PositionPacket, OtherSentencesAreIgnored) {
  EXPECT_EQ(parse_nmea("$GPGGA,220243,3708.5809,N*00").rmc, std::nullopt);
  EXPECT_EQ(parse_nmea("$*00").rmc, std::nullopt);
  EXPECT_EQ(parse_nmea("").rmc, std::nullopt);
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

/// Returns a sentence with its checksum, in digits of either case.
std::string with_checksum(const std::string& body, const std::string& digits = "0123456789ABCDEF") {
  unsigned checksum = 0;
  for (const char c : body)
    checksum ^= static_cast<unsigned char>(c);
  return "$" + body + "*" + digits[checksum / 16] + digits[checksum % 16] + "\r\n";
}

const std::string kRmcFields = "RMC,220243,A,3708.5809,N,12139.7813,W,028.8,158.3,111212,013.8,E,D";

TEST(PositionPacket, RmcOfEveryTalkerIsUsed) {
  for (const std::string talker : {"GP", "GN", "GL", "GA", "GB", "BD", "QZ", "GI"})
    EXPECT_TRUE(parse_position_packet(packet(2, with_checksum(talker + kRmcFields))).is_synchronised()) << talker;
  EXPECT_TRUE(parse_position_packet(packet(2, with_checksum("GN" + kRmcFields + ",V"))).is_synchronised())
      << "NMEA 4.1";
  EXPECT_TRUE(
      parse_position_packet(packet(2, with_checksum("GN" + kRmcFields + ",K", "0123456789abcdef"))).is_synchronised());
  EXPECT_FALSE(parse_position_packet(packet(2, with_checksum("gp" + kRmcFields))).is_synchronised());
}

/// Lidars copy what the serial line holds, which need not begin with the sentence that matters.
TEST(PositionPacket, RmcIsFoundBetweenOtherSentences) {
  const std::string rest = "200,00.0,E,0.0*11\r\n",
                    gga = with_checksum("GPGGA,220243,3708.5,N,12139.7,W,1,8,0.9,50,M,,,,");
  for (const std::string& before : {rest, gga, rest + gga, std::string{"$"}, std::string{"$GPRM"}})
    for (const std::string& after : {std::string{}, gga, std::string{"$GPRMC,2202"}})
      EXPECT_TRUE(
          parse_position_packet(packet(2, std::string{before}.append(kSentence).append(after))).is_synchronised())
          << before << after;
}

TEST(PositionPacket, UnusedLockedPpsHasAReason) {
  const auto why = [](const std::string& nmea, std::uint8_t pps = 2) {
    return std::string{why_unused(parse_position_packet(packet(pps, nmea)))};
  };
  EXPECT_EQ(why(kSentence), "");
  EXPECT_EQ(why("", 1), "") << "not locked";
  EXPECT_NE(why("").find("no NMEA sentence"), std::string::npos);
  EXPECT_NE(why(with_checksum("GPGGA,220243,3708.5809,N")).find("no RMC"), std::string::npos);
  EXPECT_NE(why(with_checksum("PUBX,04,073731.00,091202,113851.00")).find("no RMC"), std::string::npos);
  EXPECT_NE(why("$GP" + kRmcFields).find("no checksum"), std::string::npos);
  EXPECT_NE(why("$GP" + kRmcFields + "*00\r\n").find("are wrong"), std::string::npos);
  EXPECT_NE(why(with_checksum("GPRMC,,V,,,,,,,,,,N")).find("no time"), std::string::npos);
  EXPECT_NE(why(with_checksum("GPRMC,081802,V,,,,,,,210116,,,N")).find("no fix"), std::string::npos);
}

TEST(PositionPacket, RandomBytesAreIgnored) {
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
