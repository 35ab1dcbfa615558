// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>

#include "core/base/expected.hpp"
#include "drivers/velodyne/model.hpp"

namespace locus::velodyne {

/// Reads the geometry of one unit from the YAML file that users of the ROS driver velodyne_pointcloud have. Corrections
/// of angle, distance and beam origin are applied as that driver does; those of intensity (focal_distance, focal_slope,
/// min_intensity, max_intensity) are not, for intensity is passed on as measured. The two-point distance correction
/// exists on the HDL-64E only and is refused. Start-up only. Fails with one line for the user: "file:line: what is
/// wrong".
Expected<Calibration, std::string> read_calibration(const std::filesystem::path& file);

} // namespace locus::velodyne
