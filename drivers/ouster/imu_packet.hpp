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

/// Measurement of the sensor's IMU in the IMU frame; Metadata::T_sensor_imu transforms it to the sensor frame.
struct ImuMeasurement {
  Duration time; ///< time of the gyro sample, in the clock that also stamps the columns; >= 0
  Eigen::Vector3d angular_velocity_radps;
  Eigen::Vector3d specific_force_mps2;
};

struct ImuMeasurements {
  static constexpr std::size_t kMost = 64;
  std::array<ImuMeasurement, kMost> storage;
  std::size_t count = 0;

  [[nodiscard]] std::span<const ImuMeasurement> all() const { return {storage.data(), count}; }
};

/// Offsets in an IMU packet in bytes, and the units of its values: times in ns of 8 bytes, numbers of 4 bytes.
struct ImuPacketLayout {
  std::size_t bytes;                ///< length of the packet
  std::size_t first, stride, count; ///< measurements: first offset, stride, number
  std::size_t time, force, rate;    ///< offsets in a measurement: gyro time, and two vectors of three numbers
  double force_unit_mps2, rate_unit_radps;
};

/// Returns true for a packet with the header of those of several measurements, of any sensor.
bool is_standard_imu_packet(std::span<const std::byte> payload);

/// Returns the layout of the IMU packets that the sensor sends according to its metadata.
ImuPacketLayout imu_packet_layout(const Metadata& metadata);

/// Reads an IMU packet: 48 bytes in g and degrees per second, or, with newer firmware, several measurements in SI units
/// with the header and footer of a lidar packet. Measurements that are not finite or marked invalid are skipped.
/// Packets without valid measurements are rejected (flag), as are those with a wrong length, type, serial number or
/// checksum, or an impossible time. Allocates nothing, throws nothing.
std::optional<PacketError> read_imu_packet(const Metadata& metadata, std::span<const std::byte> payload,
                                           ImuMeasurements& out);

} // namespace locus::ouster
