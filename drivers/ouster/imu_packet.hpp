// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <span>

#include <Eigen/Core>

#include "core/base/expected.hpp"
#include "core/base/stamp.hpp"
#include "drivers/ouster/metadata.hpp"
#include "drivers/packet_counters.hpp"

namespace locus::ouster {

/// One measurement of the sensor's inertial unit, in its own frame: Metadata::T_sensor_imu leads to the sensor's.
struct ImuMeasurement {
  Duration time; ///< of the gyro's reading, by the clock that also times the columns; >= 0
  Eigen::Vector3d angular_velocity_radps;
  Eigen::Vector3d specific_force_mps2;
};

struct ImuMeasurements {
  static constexpr std::size_t kMost = 64;
  std::array<ImuMeasurement, kMost> storage;
  std::size_t count = 0;

  [[nodiscard]] std::span<const ImuMeasurement> all() const { return {storage.data(), count}; }
};

/// Places in an IMU packet, all in bytes, and the units of what stands there: times in ns of 8 bytes, and numbers of 4.
struct ImuPacketLayout {
  std::size_t bytes;                ///< of the packet
  std::size_t first, stride, count; ///< of its measurements
  std::size_t time, force, rate;    ///< in a measurement: of the gyro's reading, and three numbers each
  double force_unit_mps2, rate_unit_radps;
};

/// Of the packets that Metadata says the sensor sends.
ImuPacketLayout imu_packet_layout(const Metadata& metadata);

/// Reads an IMU packet: of 48 bytes, with g and degrees per second, or one of newer firmware that opens and ends as a
/// lidar packet does and holds several measurements in SI units. What is not finite, or what the sensor calls invalid,
/// is left out; a packet without anything else is refused (flag), as is one of another length, type, serial number or
/// checksum, or of an impossible time. Allocates nothing, throws nothing.
std::optional<PacketError> read_imu_packet(const Metadata& metadata, std::span<const std::byte> payload,
                                           ImuMeasurements& out);

} // namespace locus::ouster
