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

/// UDP profiles that can be read (key udp_profile_lidar): what a pixel of a lidar packet holds.
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

/// Where one return of a pixel stands: its range in 32 bits from `range_at`, its reflectivity in a byte.
struct EchoField {
  std::size_t range_at;
  std::size_t reflectivity_at;
};

/// A profile as data. Layouts: Ouster, "Firmware User Manual", "Lidar data packet format", and the tables of the
/// maker's SDK (github.com/ouster-lidar/ouster-sdk, parsing.cpp).
struct ProfileSpec {
  std::string_view name; ///< as the metadata has it
  std::size_t pixel_bytes;
  unsigned range_bits;
  unsigned range_shift; ///< a range counts 2^range_shift mm
  std::size_t echoes;   ///< used ones of echo_fields
  std::array<EchoField, 2> echo_fields;
};

inline constexpr std::size_t kProfiles = 8;
const ProfileSpec& spec(Profile profile);

/// Nothing for a profile that cannot be read.
std::optional<Profile> profile_from_string(std::string_view name);

/// "LEGACY, RNG19_RFL8_SIG16_NIR16, ...".
std::string known_profiles();

/// Sizes and places in a lidar packet, all in bytes from its begin or from that of a column.
///
/// Legacy packets are columns only: a header of 16 bytes (time, measurement id, frame id, encoder), the pixels, a
/// status of 4 bytes. All others have 32 bytes before the columns (type, frame, initialisation, serial number) and 32
/// behind them; their columns begin with 12 bytes (time, measurement id, status).
struct PacketFormat {
  PacketFormat(Profile profile, bool safety_header, std::size_t pixels_per_column, std::size_t columns_per_packet);

  ProfileSpec profile;
  bool legacy;
  bool safety_header; ///< of the profiles for functional safety: its fields are elsewhere
  std::size_t pixels_per_column, columns_per_packet;
  std::size_t column_bytes, packet_bytes;

  [[nodiscard]] const std::byte* column(const std::byte* packet, std::size_t i) const {
    return packet + (legacy ? 0 : kPacketHeaderBytes) + i * column_bytes;
  }
  /// Time of measurement, ns of the sensor's clock.
  [[nodiscard]] static std::uint64_t time_of(const std::byte* column);
  /// Which of the columns of a turn it is.
  [[nodiscard]] static std::uint16_t measurement_id_of(const std::byte* column);
  [[nodiscard]] bool is_valid(const std::byte* column) const;
  [[nodiscard]] const std::byte* pixels_of(const std::byte* column) const {
    return column + (legacy ? kLegacyColumnHeaderBytes : kColumnHeaderBytes);
  }

  /// What a packet says of itself. Legacy ones say no type, initialisation or serial number: as if right, and 0.
  struct Header {
    bool is_lidar_packet;
    std::uint32_t frame_id;
    std::uint32_t init_id; ///< changes with every start of the sensor and every change of its settings
    std::uint64_t serial_number;
  };
  /// Precondition: packet_bytes of it.
  [[nodiscard]] Header header(std::span<const std::byte> packet) const;

  static constexpr std::size_t kPacketHeaderBytes = 32, kPacketFooterBytes = 32;
  static constexpr std::size_t kColumnHeaderBytes = 12, kLegacyColumnHeaderBytes = 16, kLegacyColumnFooterBytes = 4;
};

/// The format of a lidar packet of any of the profiles and of 16 columns, as they are told from all else without
/// metadata: by length and header, which some profiles have in common. Nothing for what looks like no lidar packet.
std::optional<PacketFormat> format_of_lidar_packet(std::span<const std::byte> packet);

/// What opens every packet of 32 + n + 32 bytes but those for functional safety.
struct StandardHeader {
  std::uint16_t packet_type;
  std::uint16_t frame_id;
  std::uint32_t init_id;
  std::uint64_t serial_number;

  static constexpr std::uint16_t kLidar = 1, kImu = 2;
};
/// Precondition: at least 32 bytes.
StandardHeader read_standard_header(std::span<const std::byte> packet);

} // namespace locus::ouster
