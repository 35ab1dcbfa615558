// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

#include "core/surface_map.hpp"

namespace locus::tools {

/// Writes the surfaces of the map as a binary PCD, one point for each fine voxel: the mean of what fell into it, and
/// the normal where that is a plane, else zeros. By hand, for this is all of PCD that is needed and libpcl-io brings
/// VTK. Throws Failure.
void write_map(const std::filesystem::path& path, const SurfaceMap& map);

} // namespace locus::tools
