// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>

#include "core/base/names.hpp"
#include "drivers/net/datagram.hpp"

namespace locus {

/// Makers of lidars whose packets cannot be decoded, or not without metadata; reported to the user who recorded them.
enum class OtherMaker : std::uint8_t { hesai, ouster, livox, robosense, seyond };
constexpr auto names_of(OtherMaker) {
  return std::to_array<std::string_view>({"Hesai", "Ouster", "Livox", "RoboSense", "Seyond"});
}
inline constexpr std::size_t kOtherMakers = names_of(OtherMaker{}).size();

/// Recognises a packet that cannot be decoded by itself. Empty for decodable packets and for those of no known lidar.
///
/// - Hesai: matches a model that is not supported, see hesai::look_at().
/// - Livox, RoboSense, Seyond: see unsupported_maker().
/// - Ouster: is sent to port 7502 or 7503, or has the length that Ouster's "Sensor data packet format" gives for 16
///   columns of 16 to 128 pixels in one of the profiles (column packets may go to any port), or is_ouster_imu().
std::optional<OtherMaker> other_maker(const Datagram& datagram);

/// Recognises the packets of makers for which there is no decoder, by what they begin with:
///
/// - Livox: version and data type of the protocols of the maker's two SDKs, with the length that follows from them.
/// - RoboSense: the identifiers of MSOP (points) and DIFOP (state) packets.
/// - Seyond (formerly Innovusion): the magic number of data and status packets, and the length that follows.
std::optional<OtherMaker> unsupported_maker(std::span<const std::byte> payload);

/// Recognises a packet of the inertial unit of an Ouster: the legacy one by its length and the usual port, that of
/// newer firmware by its header.
bool is_ouster_imu(const Datagram& datagram);

} // namespace locus
