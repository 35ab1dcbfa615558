// SPDX-License-Identifier: Apache-2.0
#include "drivers/hesai/packet_parts.hpp"

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdint>

#include "drivers/hesai/checksum.hpp"
#include "drivers/wire.hpp"

namespace locus::hesai {

namespace {

constexpr std::size_t kNumberBytes = 4, kSumBytes = 4;
constexpr std::size_t kSafetyBytes = 17, kImuBytes = 22, kSignatureBytes = 32;

/// Flag bits in the last byte of a 12-byte header.
constexpr std::size_t kFlagsAt = 11;
constexpr unsigned kHasNumber = 0x01, kHasImu = 0x02, kHasSafety = 0x04, kHasSignature = 0x08, kHasConfidence = 0x10;

/// Date of six bytes: year, month, day, hour, minute, second; or, if the first two are 0, seconds since 1970, most
/// significant byte first. The year counts from 1900 or, with some models and firmware, from 2000, where an unlocked
/// clock may start: values below 70 are in this century.
constexpr std::size_t kDateBytes = 6;
constexpr unsigned kFirstOf1900 = 70;

unsigned number(std::byte byte) { return std::to_integer<unsigned>(byte); }
bool counts_seconds(const std::byte* date) { return number(date[0]) == 0 && number(date[1]) == 0; }

std::optional<std::chrono::seconds> read_date(const std::byte* date) {
  if (counts_seconds(date)) {
    std::uint64_t seconds = 0;
    for (std::size_t i = 2; i < kDateBytes; ++i)
      seconds = seconds << 8 | number(date[i]);
    return std::chrono::seconds{static_cast<std::int64_t>(seconds)};
  }
  const int century = number(date[0]) < kFirstOf1900 ? 2000 : 1900;
  const std::chrono::year_month_day day{std::chrono::year{century + static_cast<int>(number(date[0]))},
                                        std::chrono::month{number(date[1])}, std::chrono::day{number(date[2])}};
  if (!day.ok() || number(date[3]) > 23 || number(date[4]) > 59 || number(date[5]) > 60)
    return std::nullopt;
  return std::chrono::sys_days{day}.time_since_epoch() + std::chrono::hours{number(date[3])} +
         std::chrono::minutes{number(date[4])} + std::chrono::seconds{number(date[5])};
}

void write_date(std::byte* date, std::chrono::seconds since_1970) {
  using namespace std::chrono;
  if (counts_seconds(date)) {
    for (std::size_t i = 2; i < kDateBytes; ++i)
      date[i] = static_cast<std::byte>(since_1970.count() >> 8 * (kDateBytes - 1 - i));
    return;
  }
  const sys_days day = floor<days>(sys_seconds{since_1970});
  const year_month_day calendar{day};
  const hh_mm_ss clock{sys_seconds{since_1970} - day};
  const int year = static_cast<int>(calendar.year());
  const int year_zero = year >= 2000 && number(date[0]) < kFirstOf1900 ? 2000 : 1900;
  const std::array<std::int64_t, kDateBytes> fields{year - year_zero,
                                                    static_cast<unsigned>(calendar.month()),
                                                    static_cast<unsigned>(calendar.day()),
                                                    clock.hours().count(),
                                                    clock.minutes().count(),
                                                    clock.seconds().count()};
  std::ranges::transform(fields, date, [](std::int64_t field) { return static_cast<std::byte>(field); });
}

/// Expected checksums.
struct Sums {
  std::uint32_t blocks, tail;
};

Sums sums_of(const ModelSpec& spec, const PacketParts& parts, std::span<const std::byte> packet) {
  const std::size_t header = spec.layout.header;
  return {crc32(packet.subspan(header, spec.layout.body() - header)),
          crc32(packet.subspan(parts.tail, parts.end - parts.tail))};
}

} // namespace

std::optional<PacketParts> parts_of(const ModelSpec& spec, std::span<const std::byte> packet) {
  const PacketLayout& layout = spec.layout;
  if (packet.size() < layout.body() + layout.tail.bytes)
    return std::nullopt;
  if (!layout.has_checksums) {
    const std::size_t end = layout.body() + layout.tail.bytes;
    const bool has_number = packet.size() == end + kNumberBytes;
    return has_number || packet.size() == end ? std::optional{PacketParts{layout.body(), has_number, packet.size()}}
                                              : std::nullopt;
  }
  const unsigned flags = number(packet[kFlagsAt]);
  const auto bytes_if = [flags](unsigned flag, std::size_t bytes) { return (flags & flag) != 0 ? bytes : 0; };
  const std::size_t tail = layout.body() + kSumBytes + bytes_if(kHasSafety, kSafetyBytes);
  const std::size_t end = tail + layout.tail.bytes + bytes_if(kHasNumber, kNumberBytes) + bytes_if(kHasImu, kImuBytes);
  if (((flags & kHasConfidence) != 0 && layout.channel < 4) ||
      packet.size() != end + kSumBytes + bytes_if(kHasSignature, kSignatureBytes))
    return std::nullopt;
  return PacketParts{tail, (flags & kHasNumber) != 0, end};
}

bool has_right_checksums(const ModelSpec& spec, const PacketParts& parts, std::span<const std::byte> packet) {
  const Sums right = sums_of(spec, parts, packet);
  return read_u32(packet.data() + spec.layout.body()) == right.blocks &&
         read_u32(packet.data() + parts.end) == right.tail;
}

void seal(const ModelSpec& spec, const PacketParts& parts, std::span<std::byte> packet) {
  const Sums right = sums_of(spec, parts, packet);
  put_little_endian(packet.data() + spec.layout.body(), right.blocks, kSumBytes);
  put_little_endian(packet.data() + parts.end, right.tail, kSumBytes);
}

unsigned distance_unit_mm(const PacketLayout& layout, std::span<const std::byte> packet) {
  return layout.header == 0 ? 4U : number(packet[layout.header - 3]);
}

std::optional<Duration> read_time(const std::byte* tail, const TailLayout& layout) {
  constexpr std::uint32_t kSecond_us = 1'000'000; // inclusive: it occurs occasionally
  const auto seconds = read_date(tail + layout.date);
  const std::uint32_t us = read_u32(tail + layout.time);
  if (!seconds || us > kSecond_us || *seconds < std::chrono::seconds{1} ||
      *seconds > std::chrono::duration_cast<std::chrono::seconds>(kLatestStamp.time_since_epoch()))
    return std::nullopt;
  return *seconds + std::chrono::microseconds{us};
}

void write_time(std::byte* tail, const TailLayout& layout, Duration time) {
  const Duration shown = std::max(time, Duration{});
  const auto seconds = std::chrono::floor<std::chrono::seconds>(shown);
  write_date(tail + layout.date, seconds);
  const auto us = std::chrono::duration_cast<std::chrono::microseconds>(shown - seconds).count();
  put_little_endian(tail + layout.time, static_cast<std::uint64_t>(us), 4);
}

} // namespace locus::hesai
