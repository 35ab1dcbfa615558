// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <filesystem>
#include <vector>

namespace locus::tools {

/// Point in KITTI's convention: frame of the lidar, x forward, y left, z up.
struct KittiPoint {
  float x_m, y_m, z_m;
  float reflectance; ///< 0..1
};

/// Upper bound on the points of a turn, above what the lidar can fire.
inline constexpr std::size_t kMaxKittiPoints = 200'000;

/// Correction of the vertical angle of every laser: the points in KITTI's files lie too low. Found by Deschaud,
/// "IMLS-SLAM: Scan-to-Model Matching Based on 3D Data", ICRA 2018; CT-ICP and KISS-ICP use this value.
inline constexpr double kKittiVerticalAngle_deg = 0.205;

/// Raises the ray of each point within its vertical plane through the lidar; range and azimuth stay. A point straight
/// above or below, which has no such plane, is unchanged.
void raise(std::vector<KittiPoint>& points, double angle_deg);

/// Reads the file of a sweep: .bin, binary points, of a synchronised drive; otherwise .txt, `x y z reflectance` per
/// line. Returns false if it cannot be read, or holds no, incomplete or too many points.
bool read_kitti_points(const std::filesystem::path& file, std::vector<KittiPoint>& points);

} // namespace locus::tools
