// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <string_view>

#include "drivers/net/datagram.hpp"

namespace locus {

/// Makers of lidars whose packets cannot be read, at least not by themselves, so that who recorded one learns it.
enum class OtherMaker : std::uint8_t { hesai, ouster };
inline constexpr std::size_t kOtherMakers = 2;

std::string_view to_string(OtherMaker maker);

/// Whose packet a datagram is by its looks; nothing for those that can be read and for whatever looks like no lidar's.
///
/// - Hesai: looks like a packet of a model that cannot be read, see hesai::look_at().
/// - Ouster: goes to one of its ports, 7502 and 7503, or has the length that its "Sensor data packet format" gives for
///   16 columns of 16 to 128 pixels in one of the profiles (the lidar's columns may go to any port).
std::optional<OtherMaker> other_maker(const Datagram& datagram);

} // namespace locus
