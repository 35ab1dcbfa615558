// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "config/config.hpp"
#include "drivers/files/capture_folder.hpp"
#include "locus_replay/arguments.hpp"

namespace locus::tools {

/// Throws Failure if the run would overwrite its input, write two results to one file, or leave one where the next run
/// would read it as part of the recording. Writes nothing itself.
void check_nothing_is_written_over(const Arguments& arguments, const CaptureFolder& folder, const Config& config);

} // namespace locus::tools
