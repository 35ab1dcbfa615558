// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "config/config.hpp"
#include "daemon/figures.hpp"
#include "daemon/ingest.hpp"
#include "locus_replay/recording.hpp"

namespace locus::tools {

/// A recording that was played to its end.
struct PlayedRecording {
  const std::filesystem::path& capture;
  const Config& config;
  const Recording& recording;
  const daemon::Ingest& ingest;
  const daemon::Figures& figures; ///< of the same ingest
};

/// Why no result can be made of it, one line for the user: it runs backwards, or has no valid data packet and no cloud
/// that can be used. Nothing where all is well.
std::optional<std::string> why_no_result(const PlayedRecording& played);

/// What in it is unlikely to be what the user meant, a line each.
std::vector<std::string> warnings_about(const PlayedRecording& played);

} // namespace locus::tools
