// SPDX-License-Identifier: Apache-2.0
#include "drivers/ouster/checksum.hpp"

#include <array>

#if defined(__x86_64__)
#include <immintrin.h>
#endif

#include "drivers/wire.hpp"

namespace locus::ouster {

namespace {

constexpr std::uint64_t kPolynomial = 0xC96C'5795'D787'0F42;
constexpr std::size_t kChecksumBytes = 8;

/// Number of bytes processed at once, with one table for the contribution of each position (slicing).
constexpr std::size_t kSlices = 16;
using Tables = std::array<std::array<std::uint64_t, 256>, kSlices>;

constexpr Tables make_tables() {
  Tables tables{};
  for (std::uint64_t byte = 0; byte < 256; ++byte) {
    std::uint64_t crc = byte;
    for (int bit = 0; bit < 8; ++bit)
      crc = crc >> 1 ^ ((crc & 1) != 0 ? kPolynomial : 0);
    tables[0][byte] = crc;
  }
  for (std::size_t slice = 1; slice < kSlices; ++slice) {
    for (std::size_t byte = 0; byte < 256; ++byte) {
      const std::uint64_t before = tables[slice - 1][byte];
      tables[slice][byte] = tables[0][before & 0xFF] ^ before >> 8;
    }
  }
  return tables;
}

constexpr Tables kTables = make_tables();

/// Returns the contribution of eight bytes that are followed by `behind` bytes.
std::uint64_t crc_of_eight(std::uint64_t bytes, std::size_t behind) {
  std::uint64_t crc = 0;
  for (std::size_t i = 0; i < 8; ++i)
    crc ^= kTables[behind + 7 - i][bytes >> (8 * i) & 0xFF];
  return crc;
}

#if defined(__x86_64__)

/// Returns x^exponent modulo the polynomial; the highest bit is x^0, as in the checksum.
constexpr std::uint64_t power(int exponent) {
  std::uint64_t value = std::uint64_t{1} << 63;
  for (; exponent > 0; --exponent)
    value = value >> 1 ^ ((value & 1) != 0 ? kPolynomial : 0);
  return value;
}

constexpr std::size_t kLaneBytes = 16, kLanes = 4; ///< folded in parallel
constexpr std::size_t kBlockBytes = kLanes * kLaneBytes;

struct Lane {
  __m128i bits;
};

[[gnu::target("pclmul,sse4.1")]] inline Lane operator^(Lane a, Lane b) { return {_mm_xor_si128(a.bits, b.bits)}; }

/// Multiplies a lane by x^kBits modulo the polynomial, to be added to the lane kBits further on. In this bit order a
/// carry-less product is too high by one power of x, so the factors are one power lower.
template <int kBits> [[gnu::target("pclmul,sse4.1")]] inline Lane moved_ahead(Lane lane) {
  constexpr std::uint64_t kOfFirst = power(kBits + 63), kOfSecond = power(kBits - 1);
  const __m128i factors = _mm_set_epi64x(static_cast<long long>(kOfSecond), static_cast<long long>(kOfFirst));
  return Lane{_mm_clmulepi64_si128(lane.bits, factors, 0x00)} ^ Lane { _mm_clmulepi64_si128(lane.bits, factors, 0x11) };
}

/// Folds all whole lanes and leaves the remaining bytes in `bytes`. (V. Gopal et al., Fast CRC computation for generic
/// polynomials using PCLMULQDQ, Intel, 2009.) Precondition: at least kBlockBytes.
[[gnu::target("pclmul,sse4.1")]] std::uint64_t fold(std::uint64_t crc, std::span<const std::byte>& bytes) {
  const auto load = [&](std::size_t lane) {
    return Lane{_mm_loadu_si128(reinterpret_cast<const __m128i*>(bytes.data() + kLaneBytes * lane))};
  };
  std::array<Lane, kLanes> lanes{load(0), load(1), load(2), load(3)};
  lanes[0] = lanes[0] ^ Lane { _mm_set_epi64x(0, static_cast<long long>(crc)) };
  for (bytes = bytes.subspan(kBlockBytes); bytes.size() >= kBlockBytes; bytes = bytes.subspan(kBlockBytes))
    for (std::size_t lane = 0; lane < kLanes; ++lane)
      lanes[lane] = moved_ahead<8 * kBlockBytes>(lanes[lane]) ^ load(lane);
  Lane sum = lanes[0];
  for (std::size_t lane = 1; lane < kLanes; ++lane)
    sum = moved_ahead<8 * kLaneBytes>(sum) ^ lanes[lane];
  for (; bytes.size() >= kLaneBytes; bytes = bytes.subspan(kLaneBytes))
    sum = moved_ahead<8 * kLaneBytes>(sum) ^ load(0);
  return crc_of_eight(static_cast<std::uint64_t>(_mm_extract_epi64(sum.bits, 0)), 8) ^
         crc_of_eight(static_cast<std::uint64_t>(_mm_extract_epi64(sum.bits, 1)), 0);
}

#endif

} // namespace

std::uint64_t crc64(std::span<const std::byte> bytes) {
  std::uint64_t crc = ~std::uint64_t{0};
#if defined(__x86_64__)
  static const bool kFolds = __builtin_cpu_supports("pclmul") != 0 && __builtin_cpu_supports("sse4.1") != 0;
  if (kFolds && bytes.size() >= kBlockBytes)
    crc = fold(crc, bytes);
#endif
  for (; bytes.size() >= kSlices; bytes = bytes.subspan(kSlices))
    crc = crc_of_eight(crc ^ read_u64(bytes.data()), 8) ^ crc_of_eight(read_u64(bytes.data() + 8), 0);
  for (const std::byte byte : bytes)
    crc = kTables[0][(crc ^ std::to_integer<std::uint64_t>(byte)) & 0xFF] ^ crc >> 8;
  return ~crc;
}

bool has_right_checksum(std::span<const std::byte> packet) {
  const std::size_t covered = packet.size() - kChecksumBytes;
  return crc64(packet.first(covered)) == read_u64(packet.data() + covered);
}

void seal(std::span<std::byte> packet) {
  const std::size_t covered = packet.size() - kChecksumBytes;
  put_little_endian(packet.data() + covered, crc64(packet.first(covered)), kChecksumBytes);
}

} // namespace locus::ouster
