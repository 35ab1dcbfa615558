// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "core/base/expected.hpp"
#include "drivers/hesai/model.hpp"

namespace locus::hesai {

/// Reads the angles of one unit from its angle correction file, as the lidar, the maker's viewer and the drivers of ROS
/// have it: a line "Laser id,Elevation,Azimuth" (or "Channel,..."), then one for each laser, from 1 on, in degrees. A
/// line of the file's version before it and one of its hash behind the lasers may be there. Start-up only. Fails with
/// one line for the user: "file:line: what is wrong".
Expected<Calibration, std::string> read_calibration(const std::filesystem::path& file);

/// The same from the text of a file, which an error calls `name`.
Expected<Calibration, std::string> parse_calibration(std::string_view text, std::string_view name);

} // namespace locus::hesai
