// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include <bit>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "drivers/ouster/checksum.hpp"
#include "drivers/ouster/metadata.hpp"
#include "drivers/wire.hpp"

namespace locus::sim {

/// Lidar packet of an Ouster, built byte by byte: well-formed, every range 0 until it is set. One owner.
class OusterPacket {
 public:
  static constexpr std::int64_t kColumnNs = 97'656; ///< of 1024x10

  explicit OusterPacket(const ouster::Metadata& metadata, std::size_t first_column = 0,
                        std::uint64_t time_ns = 1'000'000'000, std::uint32_t frame_id = 1)
      : format_(metadata.packet_format()), turn_(metadata.columns_per_frame), bytes_(format_.packet_bytes) {
    if (format_.safety_header) {
      put(0, 1, 1);
      put(1, metadata.init_id, 3);
      put(4, frame_id, 4);
      put(11, metadata.serial_number, 5);
    } else if (!format_.legacy) {
      put(0, 1, 2);
      put(2, frame_id, 2);
      put(4, metadata.init_id, 3);
      put(7, metadata.serial_number, 5);
    }
    for (std::size_t i = 0; i < format_.columns_per_packet; ++i) {
      set_time(i, time_ns + i * std::uint64_t{kColumnNs});
      set_measurement_id(i, (first_column + i) % turn_);
      set_valid(i, true);
      if (format_.legacy)
        put(column(i) + 10, frame_id, 2);
    }
    seal();
  }

  void set_time(std::size_t i, std::uint64_t ns) { put(column(i), ns, 8); }
  void set_measurement_id(std::size_t i, std::size_t id) {
    put(column(i) + 8, id, 2);
    if (format_.legacy)
      put(column(i) + 12, id * 90112 / turn_, 4);
  }
  void set_valid(std::size_t i, bool valid) {
    if (format_.legacy)
      put(column(i) + format_.column_bytes - 4, valid ? 0xFFFFFFFF : 0, 4);
    else
      put(column(i) + 10, valid ? 1 : 0, 2);
  }
  void set_return(std::size_t i, std::size_t pixel, std::uint32_t range_mm, std::uint8_t reflectivity = 10,
                  std::size_t echo = 0) {
    const auto& profile = format_.profile;
    const std::size_t at = column(i) + (format_.legacy ? 16U : 12U) + pixel * profile.pixel_bytes;
    put(at + profile.echo_fields[echo].range_at, range_mm >> profile.range_shift, profile.range_shift > 0 ? 2 : 3);
    put(at + profile.echo_fields[echo].reflectivity_at, reflectivity, 1);
  }
  void put(std::size_t at, std::uint64_t value, std::size_t count) { put_little_endian(&bytes_[at], value, count); }
  /// Updates the checksum. Call after the last change.
  void seal() {
    if (!format_.legacy && !format_.safety_header)
      put(bytes_.size() - 8, ouster::crc64(payload().first(bytes_.size() - 8)), 8);
  }

  [[nodiscard]] std::span<const std::byte> payload() const { return bytes_; }

 private:
  [[nodiscard]] std::size_t column(std::size_t i) const {
    return static_cast<std::size_t>(format_.column(bytes_.data(), i) - bytes_.data());
  }

  ouster::PacketFormat format_;
  std::size_t turn_;
  std::vector<std::byte> bytes_;
};

/// Builds an IMU packet of 48 bytes.
inline std::vector<std::byte> ouster_imu_packet(std::uint64_t time_ns, const Eigen::Vector3f& force_g,
                                                const Eigen::Vector3f& rate_dps) {
  std::vector<std::byte> bytes(48);
  for (const std::size_t at : {0U, 8U, 16U})
    put_little_endian(&bytes[at], time_ns, 8);
  for (std::size_t i = 0; i < 3; ++i) {
    const auto axis = static_cast<Eigen::Index>(i);
    put_little_endian(&bytes[24 + 4 * i], std::bit_cast<std::uint32_t>(force_g[axis]), 4);
    put_little_endian(&bytes[36 + 4 * i], std::bit_cast<std::uint32_t>(rate_dps[axis]), 4);
  }
  return bytes;
}

} // namespace locus::sim
