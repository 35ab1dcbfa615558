// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "core/base/expected.hpp"
#include "core/base/stamp.hpp"

namespace locus::tools {

/// Time as written in a file or a name, in a unit that is derived from all of them.
struct TimeText {
  std::string text;
  std::string sweep; ///< file name in its row; empty if there is none
  std::string place; ///< for errors: "times.txt:17"
};

/// Reads the rows of a table whose first column is a time, separated by commas or blanks; EuRoC's data.csv has a file
/// name in the second. Skips blank lines, comments and a header. Fails with one line for the user.
Expected<std::vector<TimeText>, std::string> read_times(const std::filesystem::path& file);

/// Converts to instants. The unit is the one of s, ms, us and ns in which most intervals are those of a lidar's sweeps,
/// 5 ms to 5 s: three decades, so it is unique. Times must increase strictly. Fails with one line for the user.
Expected<std::vector<Stamp>, std::string> stamps_of(std::span<const TimeText> times);

/// Returns the median interval, at least 5 ms; 100 ms for fewer than two stamps.
Duration usual_step(std::span<const Stamp> stamps);

} // namespace locus::tools
