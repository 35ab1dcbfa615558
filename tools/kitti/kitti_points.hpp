// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <filesystem>
#include <vector>

namespace locus::tools {

/// As KITTI has it: in the frame of the lidar, x forward, y left, z up.
struct KittiPoint {
  float x_m, y_m, z_m;
  float reflectance; ///< 0..1
};

/// More than the lidar can fire in a turn.
inline constexpr std::size_t kMaxKittiPoints = 200'000;

/// What KITTI's files lack in the vertical angle of every laser: their points lie lower than the lidar saw them. Found
/// by Deschaud, "IMLS-SLAM: Scan-to-Model Matching Based on 3D Data", ICRA 2018; of this size in CT-ICP and KISS-ICP.
inline constexpr double kKittiVerticalAngle_deg = 0.205;

/// Turns the ray of each point upwards in its vertical plane, about the lidar: range and azimuth stay. A point straight
/// above or below, which has no such plane, stays where it is.
void raise(std::vector<KittiPoint>& points, double angle_deg);

/// Reads a sweep's file: of a drive that was synchronised a .bin, the points as they lie in memory; of one that was not
/// a .txt, `x y z reflectance` in each line. False if it cannot be read, holds none, a part of one, or too many.
bool read_kitti_points(const std::filesystem::path& file, std::vector<KittiPoint>& points);

} // namespace locus::tools
