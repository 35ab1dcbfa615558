// SPDX-License-Identifier: Apache-2.0
#include "drivers/hesai/checksum.hpp"

#include <gtest/gtest.h>

#include <random>
#include <string_view>
#include <vector>

namespace locus::hesai {
namespace {

/// Reference implementation, bit by bit.
std::uint32_t slowly(std::span<const std::byte> bytes) {
  std::uint32_t crc = 0xFFFF'FFFF;
  for (const std::byte byte : bytes) {
    crc ^= std::to_integer<std::uint32_t>(byte) << 24;
    for (int bit = 0; bit < 8; ++bit)
      crc = crc << 1 ^ ((crc & 0x8000'0000) != 0 ? 0x04C1'1DB7U : 0U);
  }
  return crc;
}

/// Check value of CRC-32/MPEG-2 in catalogues of CRCs.
TEST(HesaiChecksum, OfTheUsualDigits) {
  constexpr std::string_view kDigits = "123456789";
  EXPECT_EQ(crc32(std::as_bytes(std::span{kDigits})), 0x0376'E6E7U);
  EXPECT_EQ(crc32({}), 0xFFFF'FFFFU);
}

TEST(HesaiChecksum, OfAnyLengthIsThatOfTheDefinition) {
  std::mt19937 random{1};
  std::vector<std::byte> bytes(1100);
  for (std::byte& byte : bytes)
    byte = static_cast<std::byte>(random());
  for (std::size_t length = 0; length <= bytes.size(); ++length)
    ASSERT_EQ(crc32(std::span{bytes}.first(length)), slowly(std::span{bytes}.first(length))) << length;
  for (std::size_t begin = 0; begin < 40; ++begin)
    ASSERT_EQ(crc32(std::span{bytes}.subspan(begin, 772)), slowly(std::span{bytes}.subspan(begin, 772))) << begin;
}

} // namespace
} // namespace locus::hesai
