// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <span>

#include "drivers/net/datagram.hpp"
#include "drivers/velodyne/model.hpp"
#include "drivers/velodyne/position_packet.hpp"
#include "drivers/wire.hpp"
#include "fuzz/fuzz_bytes.hpp"

namespace locus::fuzz {

/// Datagrams of a lidar. A payload is part of the input, or derived from the previous one by a step of time and
/// rotation, so that a few bytes make a stream.
class PacketStream {
 public:
  /// Bits of a datagram's first byte.
  enum Step : std::uint8_t {
    kNewPayload = 1,
    kOtherLength = 2,
    kTruncated = 4,
    kOtherSender = 8,
    kPosition = 16,
    kAnyTime = 32,
  };

  /// Valid until the next call.
  const Datagram& next(FuzzBytes& bytes) {
    const auto step = bytes.take<std::uint8_t>();
    datagram_.payload = std::span{payload_}.first(length(bytes, step));
    datagram_.truncated = (step & kTruncated) != 0;
    datagram_.source_ip = step & kOtherSender;
    datagram_.destination_port = 2368;
    if ((step & kAnyTime) != 0)
      datagram_.receive_stamp = any_stamp(bytes);
    const auto later_us = bytes.take<std::uint16_t>();
    if ((step & kNewPayload) != 0)
      bytes.fill(std::span{payload_}.first(datagram_.payload.size()));
    else
      go_on(later_us, bytes.take<std::uint16_t>());
    datagram_.receive_stamp += std::chrono::microseconds{later_us};
    return datagram_;
  }

  /// Arbitrary stamp of a capture.
  static Stamp any_stamp(FuzzBytes& bytes) {
    const auto latest_ns = static_cast<std::uint64_t>(to_ns(kLatestStamp));
    return stamp_from_ns(static_cast<std::int64_t>(bytes.take<std::uint64_t>() % latest_ns));
  }

 private:
  static std::size_t length(FuzzBytes& bytes, std::uint8_t step) {
    if ((step & kOtherLength) != 0)
      return bytes.take<std::uint16_t>() % (velodyne::kDataPacketBytes + 1);
    return (step & kPosition) != 0 ? velodyne::kPositionPacketBytes : velodyne::kDataPacketBytes;
  }

  void put_u16(std::size_t at, unsigned value) {
    payload_[at] = static_cast<std::byte>(value);
    payload_[at + 1] = static_cast<std::byte>(value >> 8);
  }

  void go_on(std::uint16_t later_us, std::uint16_t turn_cdeg) {
    const std::uint32_t time_us = read_u32(payload_.data() + velodyne::kTimeOffset) + later_us;
    put_u16(velodyne::kTimeOffset, time_us);
    put_u16(velodyne::kTimeOffset + 2, time_us >> 16);
    for (std::size_t block = 0; block < velodyne::kBlocks; ++block) {
      const std::size_t azimuth = block * velodyne::kBlockBytes + 2;
      put_u16(azimuth, (read_u16(payload_.data() + azimuth) + unsigned{turn_cdeg}) % velodyne::kCdegPerTurn);
    }
  }

  std::array<std::byte, velodyne::kDataPacketBytes> payload_{};
  Datagram datagram_{.receive_stamp = stamp_from_ns(1'700'000'000'000'000'000)};
};

} // namespace locus::fuzz
