// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>

#include "drivers/files/pcap_writer.hpp"

namespace locus::test {

/// Writes pcapng in either byte order.
class PcapngFile {
 public:
  explicit PcapngFile(bool is_big_endian = false) { start_section(is_big_endian); }

  void start_section(bool is_big_endian) {
    is_big_endian_ = is_big_endian;
    Bytes body;
    put(body, 0x1A2B3C4D, 4);
    put(body, 1, 2);
    put(body, 0, 2);
    put(body, ~0ULL, 8);
    add_block(0x0A0D0D0A, body);
  }
  void add_interface(std::uint16_t link_type, std::uint32_t snap_bytes, std::optional<std::uint8_t> resolution = {},
                     std::int64_t offset_s = 0) {
    Bytes body;
    put(body, link_type, 2);
    put(body, 0, 2);
    put(body, snap_bytes, 4);
    if (resolution) {
      put(body, 9, 2);
      put(body, 1, 2);
      body.push_back(std::byte{*resolution});
      body.resize(body.size() + 3);
    }
    if (offset_s != 0) {
      put(body, 14, 2);
      put(body, 8, 2);
      put(body, static_cast<std::uint64_t>(offset_s), 8);
    }
    add_block(1, body);
  }
  void add_frame(std::uint32_t interface, std::uint64_t ticks, const Bytes& frame, const Bytes& options = {}) {
    Bytes body;
    put(body, interface, 4);
    put_packet(body, ticks, frame);
    body.resize((body.size() + 3) / 4 * 4);
    append(body, options);
    add_block(6, body);
  }
  void add_frame_without_time(const Bytes& frame) {
    Bytes body;
    put(body, frame.size(), 4);
    append(body, frame);
    add_block(3, body);
  }
  void add_old_frame(std::uint16_t interface, std::uint64_t ticks, const Bytes& frame) {
    Bytes body;
    put(body, interface, 2);
    put(body, 0, 2);
    put_packet(body, ticks, frame);
    add_block(2, body);
  }
  void add_block(std::uint32_t type, Bytes body) {
    body.resize((body.size() + 3) / 4 * 4);
    put(bytes_, type, 4);
    put(bytes_, body.size() + 12, 4);
    append(bytes_, body);
    put(bytes_, body.size() + 12, 4);
  }
  [[nodiscard]] const Bytes& bytes() const { return bytes_; }

 private:
  void put_packet(Bytes& body, std::uint64_t ticks, const Bytes& frame) const {
    put(body, ticks >> 32, 4);
    put(body, ticks & 0xFFFFFFFF, 4);
    put(body, frame.size(), 4);
    put(body, frame.size(), 4);
    append(body, frame);
  }
  void put(Bytes& out, std::uint64_t value, int count) const {
    for (int i = 0; i < count; ++i) {
      out.push_back(static_cast<std::byte>(value >> 8 * (is_big_endian_ ? count - 1 - i : i) & 0xFF));
    }
  }

  bool is_big_endian_ = false;
  Bytes bytes_;
};

/// Wraps an IPv4 packet as a capture on the interface "any" does.
inline Bytes linux_cooked(const Bytes& ip) {
  Bytes frame(16);
  frame[14] = std::byte{0x08};
  append(frame, ip);
  return frame;
}

} // namespace locus::test
