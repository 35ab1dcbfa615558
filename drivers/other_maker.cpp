// SPDX-License-Identifier: Apache-2.0
#include "drivers/other_maker.hpp"

#include <algorithm>
#include <array>
#include <span>

namespace locus {

namespace {

/// Blocks of a Pandar40, with and without the optional tail and sequence number.
constexpr std::array<std::size_t, 3> kPandar40Bytes{1256, 1262, 1266};

constexpr std::array<std::uint16_t, 2> kOusterPorts{7502, 7503};

bool opens_with(std::span<const std::byte> payload, int first, int second) {
  return payload.size() >= 2 && payload[0] == std::byte(first) && payload[1] == std::byte(second);
}

/// 16 columns: the legacy profile has 20 bytes a column and 12 a pixel; the others have 64 bytes a packet, 12 a column,
/// and 4 (RNG15), 12 (RNG19) or 16 (two returns) a pixel.
bool is_ouster_length(std::size_t bytes) {
  constexpr std::size_t kColumns = 16;
  return std::ranges::any_of(std::array<std::size_t, 4>{16, 32, 64, 128}, [&](std::size_t pixels) {
    const auto is_profile = [&](std::size_t pixel_bytes) {
      return bytes == 64 + kColumns * (12 + pixel_bytes * pixels);
    };
    return bytes == kColumns * (20 + 12 * pixels) || is_profile(4) || is_profile(12) || is_profile(16);
  });
}

} // namespace

std::string_view to_string(OtherMaker maker) { return maker == OtherMaker::hesai ? "Hesai" : "Ouster"; }

std::optional<OtherMaker> other_maker(const Datagram& datagram) {
  const std::span<const std::byte> payload = datagram.payload;
  const bool is_pandar40 =
      opens_with(payload, 0xFF, 0xEE) && std::ranges::find(kPandar40Bytes, payload.size()) != kPandar40Bytes.end();
  if (opens_with(payload, 0xEE, 0xFF) || is_pandar40)
    return OtherMaker::hesai;
  if (std::ranges::find(kOusterPorts, datagram.destination_port) != kOusterPorts.end() ||
      is_ouster_length(payload.size()))
    return OtherMaker::ouster;
  return std::nullopt;
}

} // namespace locus
