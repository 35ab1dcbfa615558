// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>

#include <fmt/format.h>

#include "drivers/files/motion_files.hpp"

namespace locus::tools {

/// Formats a span for an error or a warning, in seconds as in a TUM file.
inline std::string text_of(const std::optional<TimeSpan>& span) {
  if (!span)
    return "none";
  return fmt::format("{:.3f} to {:.3f} s", to_seconds(span->first.time_since_epoch()),
                     to_seconds(span->last.time_since_epoch()));
}

} // namespace locus::tools
