// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>

namespace locus::ouster {

/// Supported UDP profiles (key udp_profile_lidar): content of a pixel in a lidar packet.
enum class Profile : std::uint8_t {
  legacy,
  rng19,
  rng19_dual,
  rng15,
  rng15_dual,
  fusa_rng15_dual,
  rng15_zone,
  rng19_zone,
  rng19_zone_dual,
  rng15_window,
  rng19_rgb,
  rng19_rgb_dual,
  five_word_pixel,
};

/// Position of one return of a pixel: range in 32 bits at `range_at`, reflectivity in one byte.
struct EchoField {
  std::size_t range_at;
  std::size_t reflectivity_at;
};

/// Description of a profile. Layouts: Ouster, "Firmware User Manual", "Lidar data packet format", and the tables of the
/// maker's SDK (github.com/ouster-lidar/ouster-sdk, parsing.cpp).
struct ProfileSpec {
  std::string_view name; ///< name in the metadata
  std::size_t pixel_bytes;
  unsigned range_bits;
  unsigned range_shift; ///< range unit is 2^range_shift mm
  std::size_t echoes;   ///< used elements of echo_fields
  std::array<EchoField, 2> echo_fields;
};

inline constexpr std::size_t kProfiles = 13;
const ProfileSpec& spec(Profile profile);

/// Returns the profile; empty if it is not supported.
std::optional<Profile> profile_from_string(std::string_view name);

/// Returns "LEGACY, RNG19_RFL8_SIG16_NIR16, ...".
std::string known_profiles();

/// Header of 32 bytes of every packet except the legacy ones.
struct PacketHeader {
  std::uint16_t packet_type;
  std::uint32_t frame_id;
  std::uint32_t init_id; ///< changes with every start of the sensor and every change of its settings
  std::uint64_t serial_number;

  static constexpr std::uint16_t kLidar = 1, kImu = 2;
};
/// Parses the header, with the offsets of functional safety or the usual ones. Precondition: at least 32 bytes.
PacketHeader read_header(std::span<const std::byte> packet, bool is_safety_header);

/// Sizes and offsets in a lidar packet in bytes, from the start of the packet or of a column.
///
/// Legacy packets consist of columns only: a header of 16 bytes (time, measurement ID, frame ID, encoder), the pixels,
/// a status of 4 bytes. All others have 32 bytes before the columns (type, frame, initialisation, serial number) and 32
/// after them; their columns start with 12 bytes (time, measurement ID, status).
struct PacketFormat {
  PacketFormat(Profile profile, bool safety_header, std::size_t pixels_per_column, std::size_t columns_per_packet);

  ProfileSpec profile;
  bool legacy;
  bool safety_header; ///< header of functional safety, see read_header()
  std::size_t pixels_per_column, columns_per_packet;
  std::size_t column_bytes, packet_bytes;

  [[nodiscard]] const std::byte* column(const std::byte* packet, std::size_t i) const {
    return packet + (legacy ? 0 : kPacketHeaderBytes) + i * column_bytes;
  }
  /// Time of measurement, ns of the sensor's clock.
  [[nodiscard]] static std::uint64_t time_of(const std::byte* column);
  /// Index of the column within its turn.
  [[nodiscard]] static std::uint16_t measurement_id_of(const std::byte* column);
  [[nodiscard]] bool is_valid(const std::byte* column) const;
  [[nodiscard]] const std::byte* pixels_of(const std::byte* column) const {
    return column + (legacy ? kLegacyColumnHeaderBytes : kColumnHeaderBytes);
  }

  /// Parses the header. Legacy packets have neither type nor initialisation nor serial number: they count as lidar
  /// packets, and the others are 0. Precondition: `packet` has packet_bytes bytes.
  [[nodiscard]] PacketHeader header(std::span<const std::byte> packet) const;

  static constexpr std::size_t kPacketHeaderBytes = 32, kPacketFooterBytes = 32;
  static constexpr std::size_t kColumnHeaderBytes = 12, kLegacyColumnHeaderBytes = 16, kLegacyColumnFooterBytes = 4;
};

/// Recognises the format of a lidar packet of 16 columns in any profile without metadata, by length and header, which
/// some profiles have in common: header and columns are right, profile and pixels may be those of another one. Empty if
/// it does not look like a lidar packet.
std::optional<PacketFormat> format_of_lidar_packet(std::span<const std::byte> packet);

/// Returns the number of pixels per column of all packets of this length with 16 columns; 0 if they differ: 128 pixels
/// with RNG15 are as long as 32 with two returns.
std::size_t pixels_of_length(std::size_t packet_bytes);

} // namespace locus::ouster
