// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>

#include "core/base/expected.hpp"
#include "drivers/velodyne/model.hpp"

namespace locus::velodyne {

/// Reads the geometry of one unit from a YAML calibration file of the ROS driver velodyne_pointcloud. Corrections of
/// angle, distance and beam origin are applied as in that driver; those of intensity (focal_distance, focal_slope,
/// min_intensity, max_intensity) are ignored, since intensity is passed on as measured. The two-point distance
/// correction, which only the HDL-64E has, is rejected. For start-up only. Fails with one line for the user:
/// "file:line: what is wrong".
Expected<Calibration, std::string> read_calibration(const std::filesystem::path& file);

} // namespace locus::velodyne
