// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "core/base/stamp.hpp"

namespace locus::tools {

/// Listens to all UDP on the wire for a while and tells which lidars send, with the YAML to paste. Looks at the frames
/// themselves where that is permitted, so a service that runs is not disturbed; else at the lidars' usual ports. Throws
/// Failure.
std::string find_sensors(Duration duration);

} // namespace locus::tools
