// SPDX-License-Identifier: Apache-2.0
#include "drivers/other_maker.hpp"

#include <algorithm>
#include <array>
#include <span>

#include "drivers/hesai/model.hpp"

namespace locus {

namespace {

constexpr std::array<std::uint16_t, 2> kOusterPorts{7502, 7503};

/// Recognises packets of 16 columns: the legacy profile has 20 bytes per column and 12 per pixel; the others have 64
/// bytes per packet, 12 per column, and 4 (RNG15), 12 (RNG19) or 16 (two returns) per pixel.
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
  if (const auto looks = hesai::look_at(payload))
    return looks->model ? std::nullopt : std::optional{OtherMaker::hesai};
  if (std::ranges::find(kOusterPorts, datagram.destination_port) != kOusterPorts.end() ||
      is_ouster_length(payload.size()))
    return OtherMaker::ouster;
  return std::nullopt;
}

} // namespace locus
