// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "config/config.hpp"
#include "drivers/files/capture_folder.hpp"
#include "locus_replay/arguments.hpp"

namespace locus::tools {

/// Throws Failure where the run would write over what it reads, write two results into one file, or leave one where the
/// next run takes it for a part of the recording. Writes nothing itself.
void check_nothing_is_written_over(const Arguments& arguments, const CaptureFolder& folder, const Config& config);

} // namespace locus::tools
