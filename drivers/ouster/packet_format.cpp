// SPDX-License-Identifier: Apache-2.0
#include "drivers/ouster/packet_format.hpp"

#include <algorithm>

#include "drivers/wire.hpp"

namespace locus::ouster {

namespace {

constexpr std::uint32_t kInitIdMask = 0xFFFFFF;
constexpr std::uint64_t kSerialNumberMask = 0xFF'FFFF'FFFF;
constexpr std::uint32_t kLegacyValid = 0xFFFFFFFF;

/// Profiles in the order of Profile.
constexpr std::array<ProfileSpec, kProfiles> kSpecs{{
    {"LEGACY", 12, 20, 0, 1, {{{0, 4}}}},
    {"RNG19_RFL8_SIG16_NIR16", 12, 19, 0, 1, {{{0, 4}}}},
    {"RNG19_RFL8_SIG16_NIR16_DUAL", 16, 19, 0, 2, {{{0, 3}, {4, 7}}}},
    {"RNG15_RFL8_NIR8", 4, 15, 3, 1, {{{0, 2}}}},
    {"RNG15_RFL8_NIR8_DUAL", 8, 15, 3, 2, {{{0, 2}, {4, 6}}}},
    {"FUSA_RNG15_RFL8_NIR8_DUAL", 8, 15, 3, 2, {{{0, 2}, {4, 6}}}},
    {"RNG15_RFL8_NIR8_ZONE16", 8, 15, 3, 1, {{{0, 2}}}},
    {"RNG19_RFL8_SIG16_NIR16_ZONE16", 12, 19, 0, 1, {{{0, 4}}}},
    {"RNG19_RFL8_SIG16_ZONE16_DUAL", 16, 19, 0, 2, {{{0, 3}, {4, 7}}}},
    {"RNG15_RFL8_WIN8", 4, 15, 3, 1, {{{0, 2}}}},
    {"RNG19_RFL8_SIG16_NIR16_RGB16", 16, 19, 0, 1, {{{0, 3}}}},
    {"RNG19_RFL8_SIG16_NIR16_RGB16_DUAL", 20, 19, 0, 2, {{{0, 3}, {4, 7}}}},
    {"FIVE_WORD_PIXEL", 20, 19, 0, 2, {{{0, 3}, {4, 7}}}},
}};

constexpr std::array<std::size_t, 4> kPixels{16, 32, 64, 128}; ///< per column, of all sensors
constexpr std::size_t kUsualColumns = 16;                      ///< per packet

} // namespace

const ProfileSpec& spec(Profile profile) { return kSpecs[static_cast<std::size_t>(profile)]; }

std::optional<Profile> profile_from_string(std::string_view name) {
  const auto* const found = std::ranges::find(kSpecs, name, &ProfileSpec::name);
  return found == kSpecs.end() ? std::nullopt : std::optional{static_cast<Profile>(found - kSpecs.begin())};
}

std::string known_profiles() {
  std::string names;
  for (const ProfileSpec& one : kSpecs)
    names.append(names.empty() ? "" : ", ").append(one.name);
  return names;
}

PacketFormat::PacketFormat(Profile profile_, bool safety_header_, std::size_t pixels, std::size_t columns)
    : profile(spec(profile_)), legacy(profile_ == Profile::legacy),
      safety_header(safety_header_ || profile_ == Profile::fusa_rng15_dual), pixels_per_column(pixels),
      columns_per_packet(columns),
      column_bytes((legacy ? kLegacyColumnHeaderBytes + kLegacyColumnFooterBytes : kColumnHeaderBytes) +
                   pixels * profile.pixel_bytes),
      packet_bytes(columns * column_bytes + (legacy ? 0 : kPacketHeaderBytes + kPacketFooterBytes)) {}

std::uint64_t PacketFormat::time_of(const std::byte* column) { return read_u64(column); }
std::uint16_t PacketFormat::measurement_id_of(const std::byte* column) { return read_u16(column + 8); }

bool PacketFormat::is_valid(const std::byte* column) const {
  return legacy ? read_u32(column + column_bytes - kLegacyColumnFooterBytes) == kLegacyValid
                : (read_u16(column + 10) & 1U) != 0;
}

PacketHeader PacketFormat::header(std::span<const std::byte> packet) const {
  if (legacy)
    return {PacketHeader::kLidar, read_u16(packet.data() + 10), 0, 0};
  return read_header(packet, safety_header);
}

PacketHeader read_header(std::span<const std::byte> packet, bool is_safety_header) {
  const std::byte* const at = packet.data();
  if (is_safety_header)
    return {std::to_integer<std::uint8_t>(at[0]), read_u32(at + 4), read_u32(at + 1) & kInitIdMask,
            read_u64(at + 11) & kSerialNumberMask};
  return {read_u16(at), read_u16(at + 2), read_u32(at + 4) & kInitIdMask, read_u64(at + 7) & kSerialNumberMask};
}

std::optional<PacketFormat> format_of_lidar_packet(std::span<const std::byte> packet) {
  for (const bool is_safety_header : {false, true}) {
    for (std::size_t i = 0; i < kProfiles; ++i) {
      for (const std::size_t pixels : kPixels) {
        const PacketFormat format{static_cast<Profile>(i), is_safety_header, pixels, kUsualColumns};
        if (packet.size() != format.packet_bytes)
          continue;
        const PacketHeader header = format.header(packet);
        const bool is_one = format.legacy ? format.is_valid(format.column(packet.data(), kUsualColumns / 2))
                                          : header.packet_type == PacketHeader::kLidar && header.serial_number != 0;
        if (is_one)
          return format;
      }
    }
  }
  return std::nullopt;
}

std::size_t pixels_of_length(std::size_t packet_bytes) {
  std::size_t found = 0;
  for (std::size_t i = 0; i < kProfiles; ++i) {
    for (const std::size_t pixels : kPixels) {
      if (PacketFormat{static_cast<Profile>(i), false, pixels, kUsualColumns}.packet_bytes != packet_bytes)
        continue;
      if (found != 0 && found != pixels)
        return 0;
      found = pixels;
    }
  }
  return found;
}

} // namespace locus::ouster
