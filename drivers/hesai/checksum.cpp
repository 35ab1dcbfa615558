// SPDX-License-Identifier: Apache-2.0
#include "drivers/hesai/checksum.hpp"

#include <array>

#if defined(__x86_64__)
#include <immintrin.h>
#endif

namespace locus::hesai {

namespace {

constexpr std::uint32_t kPolynomial = 0x04C1'1DB7;

constexpr std::uint32_t times_x(std::uint32_t value) { return value << 1 ^ ((value >> 31) != 0 ? kPolynomial : 0); }

/// Number of bytes processed at once, with one table for the contribution of each position (slicing).
constexpr std::size_t kSlices = 16;
using Tables = std::array<std::array<std::uint32_t, 256>, kSlices>;

constexpr Tables make_tables() {
  Tables tables{};
  for (std::uint32_t byte = 0; byte < 256; ++byte) {
    std::uint32_t crc = byte << 24;
    for (int bit = 0; bit < 8; ++bit)
      crc = times_x(crc);
    tables[0][byte] = crc;
  }
  for (std::size_t slice = 1; slice < kSlices; ++slice) {
    for (std::size_t byte = 0; byte < 256; ++byte) {
      const std::uint32_t before = tables[slice - 1][byte];
      tables[slice][byte] = tables[0][before >> 24] ^ before << 8;
    }
  }
  return tables;
}

constexpr Tables kTables = make_tables();

/// Continues a checksum over further bytes.
std::uint32_t go_on(std::uint32_t crc, std::span<const std::byte> bytes) {
  for (; bytes.size() >= kSlices; bytes = bytes.subspan(kSlices)) {
    std::uint32_t next = 0;
    for (std::size_t i = 0; i < kSlices; ++i) {
      const std::uint32_t before = i < 4 ? crc >> (24 - 8 * i) & 0xFF : 0;
      next ^= kTables[kSlices - 1 - i][before ^ std::to_integer<std::uint32_t>(bytes[i])];
    }
    crc = next;
  }
  for (const std::byte byte : bytes)
    crc = crc << 8 ^ kTables[0][crc >> 24 ^ std::to_integer<std::uint32_t>(byte)];
  return crc;
}

#if defined(__x86_64__)

/// Returns x^exponent modulo the polynomial.
constexpr std::uint32_t power(int exponent) {
  std::uint32_t value = 1;
  for (; exponent > 0; --exponent)
    value = times_x(value);
  return value;
}

constexpr std::size_t kLaneBytes = 16, kLanes = 4; ///< folded in parallel
constexpr std::size_t kBlockBytes = kLanes * kLaneBytes;

struct Lane {
  __m128i bits;
};

[[gnu::target("pclmul,ssse3")]] inline Lane operator^(Lane a, Lane b) { return {_mm_xor_si128(a.bits, b.bits)}; }

/// Reverses the bytes of a lane: the first byte in memory is the most significant one.
[[gnu::target("pclmul,ssse3")]] inline __m128i reversed(__m128i bytes) {
  return _mm_shuffle_epi8(bytes, _mm_set_epi8(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15));
}

/// Multiplies a lane by x^kBits modulo the polynomial, to be added to the lane kBits further on.
template <int kBits> [[gnu::target("pclmul,ssse3")]] inline Lane moved_ahead(Lane lane) {
  constexpr std::uint64_t kOfHigh = power(kBits + 64), kOfLow = power(kBits);
  const __m128i factors = _mm_set_epi64x(static_cast<long long>(kOfHigh), static_cast<long long>(kOfLow));
  return Lane{_mm_clmulepi64_si128(lane.bits, factors, 0x11)} ^ Lane { _mm_clmulepi64_si128(lane.bits, factors, 0x00) };
}

/// Folds all whole lanes and leaves the remaining bytes in `bytes`. (V. Gopal et al., Fast CRC computation for generic
/// polynomials using PCLMULQDQ, Intel, 2009.) Precondition: at least kBlockBytes.
[[gnu::target("pclmul,ssse3")]] std::uint32_t fold(std::uint32_t crc, std::span<const std::byte>& bytes) {
  const auto load = [&](std::size_t lane) {
    return Lane{reversed(_mm_loadu_si128(reinterpret_cast<const __m128i*>(bytes.data() + kLaneBytes * lane)))};
  };
  std::array<Lane, kLanes> lanes{load(0), load(1), load(2), load(3)};
  lanes[0] = lanes[0] ^ Lane { _mm_set_epi32(static_cast<int>(crc), 0, 0, 0) };
  for (bytes = bytes.subspan(kBlockBytes); bytes.size() >= kBlockBytes; bytes = bytes.subspan(kBlockBytes))
    for (std::size_t lane = 0; lane < kLanes; ++lane)
      lanes[lane] = moved_ahead<8 * kBlockBytes>(lanes[lane]) ^ load(lane);
  Lane sum = lanes[0];
  for (std::size_t lane = 1; lane < kLanes; ++lane)
    sum = moved_ahead<8 * kLaneBytes>(sum) ^ lanes[lane];
  for (; bytes.size() >= kLaneBytes; bytes = bytes.subspan(kLaneBytes))
    sum = moved_ahead<8 * kLaneBytes>(sum) ^ load(0);
  std::array<std::byte, kLaneBytes> left;
  _mm_storeu_si128(reinterpret_cast<__m128i*>(left.data()), reversed(sum.bits));
  return go_on(0, left);
}

#endif

} // namespace

std::uint32_t crc32(std::span<const std::byte> bytes) {
  std::uint32_t crc = ~std::uint32_t{0};
#if defined(__x86_64__)
  static const bool kFolds = __builtin_cpu_supports("pclmul") != 0 && __builtin_cpu_supports("ssse3") != 0;
  if (kFolds && bytes.size() >= kBlockBytes)
    crc = fold(crc, bytes);
#endif
  return go_on(crc, bytes);
}

} // namespace locus::hesai
