// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <string>

#include "core/odometry/odometry_estimate.hpp"
#include "liblocus/liblocus.hpp"

namespace locus::library {

/// Converts the estimate to that of the library; `source_names` by index.
liblocus::Estimate estimate_of(const OdometryEstimate& estimate, std::span<const std::string> source_names);

} // namespace locus::library
