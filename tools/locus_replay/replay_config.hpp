// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "config/config.hpp"
#include "config/config_proposal.hpp"
#include "locus_replay/arguments.hpp"
#include "locus_replay/find_recording.hpp"
#include "locus_replay/ouster_metadata.hpp"

namespace locus::tools {

/// Reads the configuration file, or the defaults without one, applies assignments in the form of --set, and completes
/// it by the metadata of its lidars and LOCUS_ISA. Throws Failure.
Config read_configuration(const std::filesystem::path& file, const std::vector<std::string>& overrides);

/// Returns the configuration for a recording; `file` is empty if neither the user nor its folder has one: then it is
/// derived from the recording. Reports choices in `lines` for the user, and reasons in `reasons`. Throws Failure.
Config configuration_for(const FoundRecording& found, const std::filesystem::path& file, const Arguments& arguments,
                         std::vector<std::string>& lines, ConfigReasons& reasons, FoundMetadata& metadata);

} // namespace locus::tools
