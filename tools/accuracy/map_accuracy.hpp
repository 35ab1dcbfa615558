// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <functional>
#include <optional>
#include <span>
#include <string>

#include <Eigen/Core>

#include "accuracy/point_cloud_file.hpp"
#include "core/base/expected.hpp"
#include "core/base/pose.hpp"

namespace locus {

/// Distance of the points of a map from the true map (the map error of the paper's Table II).
struct MapAccuracy {
  std::optional<double> rmse_m; ///< of the distances to the nearest true point; nothing if all are outliers
  std::size_t compared = 0;     ///< points of the map within 1 m of a true one
  std::size_t outliers = 0;     ///< points without one, excluded from the error
};

/// Registers the map with the truth by ICP, starting at `T_truth_odom`, then measures each point. The truth may be
/// larger than memory: it is thinned for the ICP and streamed for the distances. Calls `progress` with the share done,
/// 0..1. Fails with one line for the user.
Expected<MapAccuracy, std::string> map_accuracy(
    std::span<const Eigen::Vector3f> map_odom, const PointCloudFile& truth, const Pose& T_truth_odom,
    const std::function<void(double)>& progress = [](double) {});

} // namespace locus
