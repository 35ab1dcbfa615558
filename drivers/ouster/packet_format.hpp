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

inline constexpr std::size_t kProfiles = 8;
const ProfileSpec& spec(Profile profile);

/// Returns the profile; empty if it is not supported.
std::optional<Profile> profile_from_string(std::string_view name);

/// Returns "LEGACY, RNG19_RFL8_SIG16_NIR16, ...".
std::string known_profiles();

/// Sizes and offsets in a lidar packet in bytes, from the start of the packet or of a column.
///
/// Legacy packets consist of columns only: a header of 16 bytes (time, measurement ID, frame ID, encoder), the pixels,
/// a status of 4 bytes. All others have 32 bytes before the columns (type, frame, initialisation, serial number) and 32
/// after them; their columns start with 12 bytes (time, measurement ID, status).
struct PacketFormat {
  PacketFormat(Profile profile, bool safety_header, std::size_t pixels_per_column, std::size_t columns_per_packet);

  ProfileSpec profile;
  bool legacy;
  bool safety_header; ///< header of the functional-safety profiles, with other offsets
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

  /// Header fields of a packet. Legacy packets have no type, initialisation or serial number: type is accepted, others
  /// are 0.
  struct Header {
    bool is_lidar_packet;
    std::uint32_t frame_id;
    std::uint32_t init_id; ///< changes with every start of the sensor and every change of its settings
    std::uint64_t serial_number;
  };
  /// Parses the header. Precondition: `packet` has packet_bytes bytes.
  [[nodiscard]] Header header(std::span<const std::byte> packet) const;

  static constexpr std::size_t kPacketHeaderBytes = 32, kPacketFooterBytes = 32;
  static constexpr std::size_t kColumnHeaderBytes = 12, kLegacyColumnHeaderBytes = 16, kLegacyColumnFooterBytes = 4;
};

/// Recognises the format of a lidar packet of 16 columns in any profile without metadata, by length and header, which
/// some profiles have in common. Empty if it does not look like a lidar packet.
std::optional<PacketFormat> format_of_lidar_packet(std::span<const std::byte> packet);

/// Header of every packet of 32 + n + 32 bytes, except the functional-safety profiles.
struct StandardHeader {
  std::uint16_t packet_type;
  std::uint16_t frame_id;
  std::uint32_t init_id;
  std::uint64_t serial_number;

  static constexpr std::uint16_t kLidar = 1, kImu = 2;
};
/// Parses the header. Precondition: at least 32 bytes.
StandardHeader read_standard_header(std::span<const std::byte> packet);

} // namespace locus::ouster
