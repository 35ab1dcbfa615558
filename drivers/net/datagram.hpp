// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "core/base/stamp.hpp"

namespace locus {

struct CloudView;
struct LidarPacket;

/// What is longer is no packet of a lidar: an Ouster with 128 beams and two returns sends 33 024 bytes.
inline constexpr std::size_t kLongestPayload = 36'864;

/// One UDP datagram as it came from a socket or a capture. Addresses and ports are in host byte order. Owns nothing:
/// the payload lives until its source is asked for the next one.
struct Datagram {
  std::span<const std::byte> payload;
  std::uint32_t source_ip = 0;
  std::uint16_t source_port = 0;
  std::uint16_t destination_port = 0;
  Stamp receive_stamp;    ///< by the kernel or the capturing computer
  bool truncated = false; ///< longer on the wire than what was kept
  /// What decoding it gives, where a recording holds no bytes but returns: the payload is then empty. Lives as long.
  const LidarPacket* decoded = nullptr;
  /// A message with a whole cloud in place of bytes, and the index of its lidar in the configuration. Lives as long.
  const CloudView* cloud = nullptr;
  std::uint8_t lidar = 0;
  /// By how much the clock of this host has been set since the time began that receive_stamp is in.
  Duration clock_set_by{};
};

/// "192.168.1.201" of an address in host byte order.
std::string dotted(std::uint32_t ip);

/// The datagrams of a recording, whatever the format of its file, in the order in which they came. One owner.
class DatagramSource {
 public:
  virtual ~DatagramSource() = default;

  /// The next datagram, valid until the next call; nullptr at the end.
  virtual const Datagram* next() = 0;

  /// How many next() has given out.
  [[nodiscard]] virtual std::uint64_t datagrams() const = 0;

  /// Why there was none at all: what was seen in their place and what to do, for the user.
  [[nodiscard]] virtual std::string why_none() const = 0;

  /// One line each about what was met so far and the user can do something about.
  [[nodiscard]] virtual std::vector<std::string> warnings() const = 0;

  /// Share of the file that has been read, 0..1; 0 where its length is not known (a pipe).
  [[nodiscard]] virtual double progress() const = 0;
};

} // namespace locus
