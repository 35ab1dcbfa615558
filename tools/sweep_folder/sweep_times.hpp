// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "core/base/expected.hpp"
#include "core/base/stamp.hpp"

namespace locus::tools {

/// A time as a file or a name has it, in a unit that only all of them together tell.
struct TimeText {
  std::string text;
  std::string sweep; ///< the file that its row names; empty where it names none
  std::string place; ///< for errors: "times.txt:17"
};

/// The rows of a table with a time first, parted by commas or blanks; EuRoC's data.csv names a file behind it. Blank
/// lines, comments and a first line that is a header are none. Fails with one line for the user.
Expected<std::vector<TimeText>, std::string> read_times(const std::filesystem::path& file);

/// The instants. Their unit is that of s, ms, us and ns in which most sweeps follow each other as those of a lidar do,
/// after 5 ms to 5 s: three decades, so no two fit. Each must be later than the one before. Fails with one line for the
/// user.
Expected<std::vector<Stamp>, std::string> stamps_of(std::span<const TimeText> times);

/// That which most of them are apart, 5 ms at least; 100 ms where there are fewer than two.
Duration usual_step(std::span<const Stamp> stamps);

} // namespace locus::tools
