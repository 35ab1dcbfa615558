// SPDX-License-Identifier: Apache-2.0
#include "drivers/ouster/checksum.hpp"

#include <string_view>
#include <vector>

#include <gtest/gtest.h>

namespace locus::ouster {
namespace {

std::span<const std::byte> bytes_of(std::string_view text) { return std::as_bytes(std::span{text}); }

/// Reference implementation, bit by bit from the polynomial.
std::uint64_t slow_crc64(std::span<const std::byte> bytes) {
  std::uint64_t crc = ~std::uint64_t{0};
  for (const std::byte byte : bytes) {
    crc ^= std::to_integer<std::uint64_t>(byte);
    for (int bit = 0; bit < 8; ++bit)
      crc = crc >> 1 ^ ((crc & 1) != 0 ? 0xC96C'5795'D787'0F42 : 0);
  }
  return ~crc;
}

TEST(OusterChecksum, MatchesTheCatalogue) {
  EXPECT_EQ(crc64(bytes_of("123456789")), 0x995D'C9BB'DF19'39FAU) << "check value of CRC-64/XZ";
  EXPECT_EQ(crc64({}), 0U);
}

TEST(OusterChecksum, MatchesTheBitwiseDefinitionForEveryLength) {
  std::vector<std::byte> bytes;
  for (unsigned i = 0; i < 200; ++i) {
    ASSERT_EQ(crc64(bytes), slow_crc64(bytes)) << bytes.size();
    bytes.push_back(static_cast<std::byte>(i * 37 + i / 7));
  }
}

TEST(OusterChecksum, DetectsEveryFlippedBit) {
  std::vector<std::byte> packet(100, std::byte{0x5A});
  const std::uint64_t crc = crc64(std::span{packet}.first(92));
  for (std::size_t i = 0; i < 8; ++i)
    packet[92 + i] = static_cast<std::byte>(crc >> (8 * i));
  EXPECT_TRUE(has_right_checksum(packet));
  for (std::size_t bit = 0; bit < 800; ++bit) {
    packet[bit / 8] ^= std::byte{1} << (bit % 8);
    EXPECT_FALSE(has_right_checksum(packet)) << bit;
    packet[bit / 8] ^= std::byte{1} << (bit % 8);
  }
}

} // namespace
} // namespace locus::ouster
