// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "config/config.hpp"
#include "locus_replay/arguments.hpp"
#include "locus_replay/find_recording.hpp"
#include "locus_replay/ouster_metadata.hpp"

namespace locus::tools {

/// The configuration of a file, or the defaults where there is none, changed by assignments as --set has them, and
/// completed by the metadata of its lidars and LOCUS_ISA. Throws Failure.
Config read_configuration(const std::filesystem::path& file, const std::vector<std::string>& overrides);

/// The configuration for a recording, `file` empty where neither the user nor its folder has one: then its files tell
/// what they can. What was taken for what is said in `lines` for the user. Throws Failure.
Config configuration_for(const FoundRecording& found, const std::filesystem::path& file, const Arguments& arguments,
                         std::vector<std::string>& lines, FoundMetadata& metadata);

} // namespace locus::tools
