// SPDX-License-Identifier: Apache-2.0
#include "drivers/files/pcapng_reader.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include <pcap/dlt.h>

#include "drivers/wire.hpp"

namespace locus {
namespace {

enum Block : std::uint32_t {
  kSection = 0x0A0D0D0A,
  kInterface = 1,
  kOldPacket = 2,
  kSimplePacket = 3,
  kEnhancedPacket = 6
};

constexpr std::uint32_t kByteOrder = 0x1A2B3C4D;
constexpr std::size_t kFrameOfBlock = 12; ///< bytes of a block around its body
constexpr std::size_t kLongestBlock = 1 << 24;

std::uint32_t swapped(std::uint32_t value) { return __builtin_bswap32(value); }

/// Converts the link type of a file to libpcap's; they differ for raw IP.
int dlt_of(std::uint16_t link_type) {
  constexpr std::uint16_t kRawIp = 101;
  return link_type == kRawIp ? DLT_RAW : link_type;
}

} // namespace

std::uint16_t PcapngReader::u16(std::size_t at) const {
  const std::uint16_t value = read_u16(&body_[at]);
  return is_big_endian_ ? __builtin_bswap16(value) : value;
}

std::uint32_t PcapngReader::u32(std::size_t at) const {
  const std::uint32_t value = read_u32(&body_[at]);
  return is_big_endian_ ? swapped(value) : value;
}

std::uint64_t PcapngReader::u64(std::size_t at) const {
  const std::uint64_t value = read_u64(&body_[at]);
  return is_big_endian_ ? __builtin_bswap64(value) : value;
}

std::optional<Stamp> PcapngReader::Interface::stamp(std::uint64_t ticks) const {
  constexpr std::int64_t kLatest_s = kLatestStamp.time_since_epoch() / std::chrono::seconds{1};
  constexpr std::uint64_t kSecond_ns = 1'000'000'000;
  std::uint64_t seconds = 0, ns = 0;
  if (is_binary) {
    const bool has_seconds = exponent < std::numeric_limits<std::uint64_t>::digits;
    seconds = has_seconds ? ticks >> exponent : 0;
    const std::uint64_t fraction = has_seconds ? ticks - (seconds << exponent) : ticks;
    ns = static_cast<std::uint64_t>(std::ldexp(static_cast<double>(fraction), -exponent) * double{kSecond_ns});
  } else {
    constexpr int kMostDigits = 19; ///< of 64 bits
    std::uint64_t per_second = 1;
    for (int i = 0; i < std::min(exponent, kMostDigits); ++i)
      per_second *= 10;
    seconds = exponent > kMostDigits ? 0 : ticks / per_second;
    const double fraction = static_cast<double>(ticks % per_second) / static_cast<double>(per_second);
    ns = per_second <= kSecond_ns ? ticks % per_second * (kSecond_ns / per_second)
         : exponent > kMostDigits ? 0
                                  : static_cast<std::uint64_t>(fraction * double{kSecond_ns});
  }
  if (seconds >= static_cast<std::uint64_t>(kLatest_s) || std::abs(offset_s / 2) >= kLatest_s)
    return std::nullopt;
  const std::int64_t since_epoch_s = static_cast<std::int64_t>(seconds) + offset_s;
  if (since_epoch_s < 0 || since_epoch_s >= kLatest_s)
    return std::nullopt;
  return stamp_from_ns(since_epoch_s * std::int64_t{kSecond_ns} + static_cast<std::int64_t>(ns));
}

bool PcapngReader::stop(std::string_view problem) {
  problem_ = problem;
  return false;
}

bool PcapngReader::read_bytes(std::span<std::byte> out) {
  return std::fread(out.data(), 1, out.size(), file_.get()) == out.size() || stop("the file ends within a block");
}

/// Reads a block. Returns false at the end of the file or on an error.
bool PcapngReader::read_block() {
  std::array<std::byte, 12> head{};
  const std::size_t type_bytes = std::fread(head.data(), 1, 4, file_.get());
  if (type_bytes == 0)
    return false;
  if (type_bytes < 4)
    return stop("the file ends within a block");
  std::size_t head_bytes = 8;
  if (read_u32(head.data()) == kSection)
    head_bytes = 12; // the byte order decides how the length is read
  if (!read_bytes(std::span{head}.subspan(4, head_bytes - 4)))
    return false;
  if (head_bytes == 12) {
    const std::uint32_t order = read_u32(&head[8]);
    if (order != kByteOrder && order != swapped(kByteOrder))
      return stop("a section without a byte order");
    is_big_endian_ = order != kByteOrder;
  }
  const auto number = [&](std::size_t at) {
    const std::uint32_t value = read_u32(&head[at]);
    return is_big_endian_ ? swapped(value) : value;
  };
  type_ = number(0);
  const std::size_t length = number(4);
  if (length % 4 != 0 || length < head_bytes + 4 || length > kLongestBlock)
    return stop("a block of an impossible length");
  body_.resize(length - kFrameOfBlock + 4);
  std::copy(head.begin() + 8, head.begin() + static_cast<std::ptrdiff_t>(head_bytes), body_.begin());
  if (!read_bytes(std::span{body_}.subspan(head_bytes - 8)))
    return false;
  if (u32(body_.size() - 4) != length)
    return stop("a block whose two lengths differ");
  body_.resize(body_.size() - 4);
  return true;
}

bool PcapngReader::open() {
  while (interfaces_.empty()) {
    if (!read_block())
      return problem_.empty() ? stop("no interface is described") : false;
    if (type_ == kSection ? !start_section() : type_ == kInterface && !add_interface())
      return false;
  }
  return true;
}

std::optional<CapturedFrame> PcapngReader::next() {
  while (problem_.empty() && read_block()) {
    if (type_ == kSection ? !start_section() : type_ == kInterface && !add_interface())
      return std::nullopt;
    if (type_ == kEnhancedPacket || type_ == kOldPacket || type_ == kSimplePacket)
      return frame();
  }
  return std::nullopt;
}

bool PcapngReader::start_section() {
  constexpr std::size_t kBytes = 16;
  interfaces_.clear();
  if (body_.size() < kBytes)
    return stop("a section cut short");
  return u16(4) == 1 || stop("a section of an unknown version");
}

bool PcapngReader::add_interface() {
  enum Option : std::uint16_t { kEnd = 0, kTimeResolution = 9, kTimeOffset = 14 };
  constexpr std::size_t kOptionsAt = 8, kMostInterfaces = 65'536;
  if (body_.size() < kOptionsAt || interfaces_.size() >= kMostInterfaces)
    return stop("a damaged description of an interface");
  Interface interface;
  interface.link_type = dlt_of(u16(0));
  interface.snap_bytes = u32(4);
  for (std::size_t at = kOptionsAt; at + 4 <= body_.size() && u16(at) != kEnd;) {
    const std::size_t bytes = u16(at + 2), value = at + 4;
    if (value + bytes > body_.size())
      return stop("a damaged description of an interface");
    if (u16(at) == kTimeResolution && bytes == 1) {
      const auto resolution = std::to_integer<unsigned>(body_[value]);
      interface.is_binary = (resolution & 0x80) != 0;
      interface.exponent = static_cast<int>(resolution & 0x7F);
    }
    if (u16(at) == kTimeOffset && bytes == 8)
      interface.offset_s = static_cast<std::int64_t>(u64(value));
    at = value + (bytes + 3) / 4 * 4;
  }
  interfaces_.push_back(interface);
  return true;
}

/// Returns the frame of a packet block of any kind; empty on an error.
std::optional<CapturedFrame> PcapngReader::frame() {
  constexpr std::size_t kHeader = 20, kSimpleHeader = 4;
  if (body_.size() < (type_ == kSimplePacket ? kSimpleHeader : kHeader)) {
    stop("a packet cut short");
    return std::nullopt;
  }
  const std::uint32_t index = type_ == kSimplePacket ? 0 : type_ == kOldPacket ? u16(0) : u32(0);
  if (index >= interfaces_.size()) {
    stop("a packet of an interface that is not described");
    return std::nullopt;
  }
  const Interface& interface = interfaces_[index];
  if (type_ != kSimplePacket)
    return frame_in(interface, kHeader, u32(16), u32(12), interface.stamp(std::uint64_t{u32(4)} << 32 | u32(8)));
  const std::uint32_t limit = interface.snap_bytes > 0 ? interface.snap_bytes : u32(0);
  return frame_in(interface, kSimpleHeader, u32(0), std::min(limit, u32(0)), Stamp{});
}

std::optional<CapturedFrame> PcapngReader::frame_in(const Interface& interface, std::size_t at,
                                                    std::uint32_t wire_bytes, std::uint32_t bytes,
                                                    std::optional<Stamp> stamp) {
  if (bytes > body_.size() - at) {
    stop("a packet longer than its block");
    return std::nullopt;
  }
  return CapturedFrame{interface.link_type, std::span{body_}.subspan(at, bytes), std::max(wire_bytes, bytes), stamp};
}

} // namespace locus
