// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "core/base/expected.hpp"
#include "drivers/files/motion_files.hpp"

namespace locus::tools {

/// Reads EuRoC's state_groundtruth_estimate0/data.csv: nanoseconds, position in metres, quaternion w x y z; ignores
/// further columns. Fails with one line for the user.
Expected<std::vector<StampedPose>, std::string> read_euroc_truth(const std::filesystem::path& file);

/// Reads the true poses of a sequence of KITTI's odometry benchmark, DATA/sequences/NN: a row of DATA/poses/NN.txt for
/// each of the stamps, T_world_camera, of camera 0. Converts them by T_camera_lidar, the row Tr of its calib.txt, to
/// poses of the lidar in the frame of the first one. Returns none if the file does not exist. Fails with one line for
/// the user.
Expected<std::vector<StampedPose>, std::string> read_kitti_truth(const std::filesystem::path& sequence,
                                                                 std::span<const Stamp> stamps);

} // namespace locus::tools
