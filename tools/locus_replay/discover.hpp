// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "locus_replay/arguments.hpp"
#include "locus_replay/open_recording.hpp"

namespace locus::tools {

/// Formats the configuration chosen for a recording, with the reason for each line, as YAML that gives the same
/// results. Motion sources without samples are comments. Throws Failure if the recording has no lidar.
std::string proposal_for(const Arguments& arguments, ChosenRecording& chosen);

} // namespace locus::tools
