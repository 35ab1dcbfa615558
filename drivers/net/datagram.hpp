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

/// Limit in bytes for the payload of a lidar packet: an Ouster with 128 beams and two returns sends 33 024 bytes.
inline constexpr std::size_t kLongestPayload = 36'864;

/// UDP datagram from a socket or a capture. Addresses and ports are in host byte order. Non-owning: the payload is
/// valid until the next datagram is requested from its source.
struct Datagram {
  std::span<const std::byte> payload;
  std::uint32_t source_ip = 0;
  std::uint16_t source_port = 0;
  std::uint16_t destination_port = 0;
  Stamp receive_stamp;    ///< assigned by the kernel or the capturing computer
  bool truncated = false; ///< payload longer on the wire than captured
  /// Decoded packet, if a recording holds returns instead of bytes; the payload is then empty. Same lifetime.
  const LidarPacket* decoded = nullptr;
  /// Message with a whole cloud instead of bytes, and the index of its lidar in the configuration. Same lifetime.
  const CloudView* cloud = nullptr;
  std::uint8_t lidar = 0;
  /// Total step of the host's clock since the start of the time base of receive_stamp.
  Duration clock_set_by{};
};

/// Formats an address in host byte order, e.g. "192.168.1.201".
std::string dotted(std::uint32_t ip);

/// Datagrams of a recording of any file format, in order of arrival. Single owner, not thread-safe.
class DatagramSource {
 public:
  virtual ~DatagramSource() = default;

  /// Returns the next datagram, valid until the next call; nullptr at the end.
  virtual const Datagram* next() = 0;

  /// Number of datagrams returned by next().
  [[nodiscard]] virtual std::uint64_t datagrams() const = 0;

  /// Explains to the user why there were no datagrams: what was found instead, and what to do.
  [[nodiscard]] virtual std::string why_none() const = 0;

  /// Returns one line for each problem so far that the user can act on.
  [[nodiscard]] virtual std::vector<std::string> warnings() const = 0;

  /// Share of the file that has been read, 0..1; 0 if its length is unknown (a pipe).
  [[nodiscard]] virtual double progress() const = 0;
};

} // namespace locus
