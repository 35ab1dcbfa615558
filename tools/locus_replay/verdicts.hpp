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

/// Recording that was played to its end.
struct PlayedRecording {
  const std::filesystem::path& capture;
  const Config& config;
  const Recording& recording;
  const daemon::Ingest& ingest;
  const daemon::Figures& figures; ///< of the same ingest
};

/// Returns why there is no result, one line for the user: the recording runs backwards, or has no valid data packet and
/// no usable cloud. Nothing if there is one.
std::optional<std::string> why_no_result(const PlayedRecording& played);

/// Returns suspicious properties of the recording, a line each.
std::vector<std::string> warnings_about(const PlayedRecording& played);

} // namespace locus::tools
