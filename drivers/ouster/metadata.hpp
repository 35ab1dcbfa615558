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

/// What fixes the zero of the sensor's clock (key timestamp_mode); `unknown` where the metadata does not say.
enum class TimestampMode : std::uint8_t { unknown, internal_osc, sync_pulse_in, ptp_1588 };
constexpr auto names_of(TimestampMode) {
  return std::to_array<std::string_view>(
      {"unknown", "TIME_FROM_INTERNAL_OSC", "TIME_FROM_SYNC_PULSE_IN", "TIME_FROM_PTP_1588"});
}

/// What the packets of one sensor do not say of themselves: its geometry and the layout of its packets.
///
/// Frames as the maker has them. The *sensor* frame is the one that locus calls the lidar's: x forward (away from the
/// connector), z up, origin at the centre of the sensor's base. The maker's *lidar* frame, in which angles and ranges
/// are measured, lies at the height of the beams and is turned by 180 degrees about z.
struct Metadata {
  std::string product_line;        ///< e.g. "OS-1-128"; empty where the file does not say
  std::uint64_t serial_number = 0; ///< 0 where the file does not say
  std::uint32_t init_id = 0;       ///< of the start of the sensor that the file is of; 0 where it does not say

  Profile profile = Profile::legacy;
  bool safety_header = false; ///< header_type FUSA
  std::size_t columns_per_frame = 1024;
  std::size_t columns_per_packet = 16;
  std::size_t pixels_per_column = 64;
  int frames_per_s = 10;
  std::size_t first_column = 0, last_column = 1023; ///< both of the window that is sent; it may go round the turn's end

  std::array<double, kMaxPixels> altitude_rad{};
  std::array<double, kMaxPixels> azimuth_rad{}; ///< of a beam from its column's direction, clockwise as seen from above
  double beam_origin_radius_m = 0.0;            ///< of the circle in the lidar frame on which beams originate
  double beam_origin_height_m = 0.0;
  Pose T_sensor_lidar, T_sensor_imu;

  bool standard_imu_packets = false; ///< udp_profile_imu ACCEL32_GYRO32_NMEA, else LEGACY
  std::size_t imu_measurements_per_packet = 1;
  TimestampMode timestamp_mode = TimestampMode::unknown;
  std::uint16_t lidar_port = kDefaultLidarPort; ///< this and the next as the sensor was set
  std::uint16_t imu_port = kDefaultImuPort;     ///< 0 where it sends no readings of its inertial unit, or unknown ones

  [[nodiscard]] PacketFormat packet_format() const {
    return {profile, safety_header, pixels_per_column, columns_per_packet};
  }
  /// In the window that is sent.
  [[nodiscard]] std::size_t columns_in_window() const {
    return (last_column + columns_per_frame - first_column) % columns_per_frame + 1;
  }
};

/// The product's name, e.g. "OS1-128"; "Ouster" where the file does not say which it is. The text lives for ever.
std::string_view name_of(const Metadata& metadata);

/// Reads what http://SENSOR/api/v1/sensor/metadata or an older client of the maker has written, of firmware 1.12 and
/// later: the form with sections, or the flat one. Values that firmware before 2.0 does not tell are the maker's
/// defaults. Start-up only. Fails with one line for the user: "file: key: what is wrong".
Expected<Metadata, std::string> read_metadata(const std::filesystem::path& file);

/// The same from text; an error does not name a file.
Expected<Metadata, std::string> parse_metadata(std::string_view text);

} // namespace locus::ouster
