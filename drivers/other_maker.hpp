// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <string_view>

#include "drivers/net/datagram.hpp"

namespace locus {

/// Makers of lidars whose packets cannot be decoded, or not without metadata; reported to the user who recorded them.
enum class OtherMaker : std::uint8_t { hesai, ouster };
inline constexpr std::size_t kOtherMakers = 2;

std::string_view to_string(OtherMaker maker);

/// Recognises a packet that cannot be decoded by itself. Empty for decodable packets and for those of no known lidar.
///
/// - Hesai: matches a model that is not supported, see hesai::look_at().
/// - Ouster: is sent to port 7502 or 7503, or has the length that Ouster's "Sensor data packet format" gives for 16
///   columns of 16 to 128 pixels in one of the profiles (column packets may go to any port).
std::optional<OtherMaker> other_maker(const Datagram& datagram);

} // namespace locus
