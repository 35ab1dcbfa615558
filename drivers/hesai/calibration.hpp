// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "core/base/expected.hpp"
#include "drivers/hesai/model.hpp"

namespace locus::hesai {

/// Reads the angles of one unit from its angle correction file, as provided by the lidar, the maker's viewer and the
/// ROS drivers: a line "Laser id,Elevation,Azimuth" (or "Channel,..."), then one line for each laser, starting at 1, in
/// degrees. A version line before them and a hash line after the lasers are optional. For start-up only. Fails with one
/// line for the user: "file:line: what is wrong".
Expected<Calibration, std::string> read_calibration(const std::filesystem::path& file);

/// Parses the text of such a file; `name` stands for it in errors.
Expected<Calibration, std::string> parse_calibration(std::string_view text, std::string_view name);

} // namespace locus::hesai
