// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>

#include "core/base/expected.hpp"
#include "core/base/names.hpp"
#include "core/base/pose.hpp"
#include "drivers/ouster/packet_format.hpp"

namespace locus::ouster {

inline constexpr std::size_t kMaxPixels = 128;
inline constexpr std::uint16_t kDefaultLidarPort = 7502;
inline constexpr std::uint16_t kDefaultImuPort = 7503;

/// Source of the zero of the sensor's clock (key timestamp_mode); `unknown` if missing in the metadata.
enum class TimestampMode : std::uint8_t { unknown, internal_osc, sync_pulse_in, ptp_1588 };
constexpr auto names_of(TimestampMode) {
  return std::to_array<std::string_view>(
      {"unknown", "TIME_FROM_INTERNAL_OSC", "TIME_FROM_SYNC_PULSE_IN", "TIME_FROM_PTP_1588"});
}

/// Properties of one sensor that its packets do not contain: geometry and packet layout.
///
/// Frames as defined by the maker. The *sensor* frame is the one that locus calls the lidar's: x forward (away from the
/// connector), z up, origin at the centre of the sensor's base. The maker's *lidar* frame, in which angles and ranges
/// are measured, lies at the height of the beams and is rotated by 180 degrees about z.
struct Metadata {
  std::string product_line;        ///< e.g. "OS-1-128"; empty if missing in the file
  std::uint64_t serial_number = 0; ///< 0 if missing in the file
  std::uint32_t init_id = 0;       ///< initialisation ID of the sensor's start when the file was written; 0 if missing

  Profile profile = Profile::legacy;
  bool safety_header = false; ///< header_type FUSA
  std::size_t columns_per_frame = 1024;
  std::size_t columns_per_packet = 16;
  std::size_t pixels_per_column = 64;
  int frames_per_s = 10;
  std::size_t first_column = 0, last_column = 1023; ///< transmitted window, inclusive; may wrap around

  std::array<double, kMaxPixels> altitude_rad{};
  std::array<double, kMaxPixels> azimuth_rad{}; ///< from its column's direction to a beam, clockwise seen from above
  double beam_origin_radius_m = 0.0;            ///< radius of the circle of beam origins in the lidar frame
  double beam_origin_height_m = 0.0;
  Pose T_sensor_lidar, T_sensor_imu;

  bool standard_imu_packets = false; ///< udp_profile_imu ACCEL32_GYRO32_NMEA, else LEGACY
  std::size_t imu_measurements_per_packet = 1;
  TimestampMode timestamp_mode = TimestampMode::unknown;
  std::uint16_t lidar_port = kDefaultLidarPort; ///< this and the next as configured in the sensor
  std::uint16_t imu_port = kDefaultImuPort;     ///< 0 if it sends no IMU packets, or in an unknown profile

  [[nodiscard]] PacketFormat packet_format() const {
    return {profile, safety_header, pixels_per_column, columns_per_packet};
  }
  /// Number of columns in the transmitted window.
  [[nodiscard]] std::size_t columns_in_window() const {
    return (last_column + columns_per_frame - first_column) % columns_per_frame + 1;
  }
};

/// Returns the product's name, e.g. "OS1-128"; "Ouster" if it is unknown. The text has static lifetime.
std::string_view name_of(const Metadata& metadata);

/// Reads metadata written by http://SENSOR/api/v1/sensor/metadata or an older client of the maker, for firmware 1.12
/// and later, in the sectioned or the flat form. Values missing in firmware before 2.0 get the maker's defaults. For
/// start-up only. Fails with one line for the user: "file: key: what is wrong".
Expected<Metadata, std::string> read_metadata(const std::filesystem::path& file);

/// Parses metadata from text; errors do not name a file.
Expected<Metadata, std::string> parse_metadata(std::string_view text);

} // namespace locus::ouster
