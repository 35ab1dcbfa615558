// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <span>
#include <vector>

#include "core/map/surface_map.hpp"

namespace locus::tools {

/// The surfaces of the map: for each fine voxel that is a plane, the mean of what fell into it and the normal.
std::vector<SurfacePoint> points_of(const SurfaceMap& map);

/// Writes them as a binary PCD. By hand, for this is all of PCD that is needed and libpcl-io brings VTK. Throws
/// Failure.
void write_map(const std::filesystem::path& path, std::span<const SurfacePoint> points);

} // namespace locus::tools
