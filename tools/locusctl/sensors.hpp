// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "core/base/stamp.hpp"

namespace locus::tools {

/// Listens to all UDP traffic for a while and lists the lidars that send, with the YAML to paste. Captures raw frames
/// if permitted, so that a running service is not disturbed; else listens at the lidars' default ports. Throws Failure.
std::string find_sensors(Duration duration);

} // namespace locus::tools
