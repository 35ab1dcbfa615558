// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <span>

#include "core/base/surface_point.hpp"

namespace locus::tools {

/// Writes the surfaces of a map as a binary PCD. Throws Failure.
void write_map(const std::filesystem::path& path, std::span<const SurfacePoint> points);

} // namespace locus::tools
