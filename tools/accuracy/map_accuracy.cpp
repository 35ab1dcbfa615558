// SPDX-License-Identifier: Apache-2.0
#include "accuracy/map_accuracy.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "accuracy/icp.hpp"
#include "accuracy/nearest_distances.hpp"
#include "accuracy/thinned_cloud.hpp"

namespace locus {
namespace {

using Points = std::vector<Eigen::Vector3f>;

constexpr float kOutlier_m = 1.0F; ///< the contract's

/// The truth in the frame of the map, where coordinates are small enough for floats, pass after pass.
class TruthWalker {
 public:
  TruthWalker(const PointCloudFile& truth, const Pose& T_odom_truth, const std::function<void(double)>& progress)
      : truth_(truth), T_odom_truth_(T_odom_truth), progress_(progress) {}

  template <class Visit> std::optional<std::string> walk(Visit&& visit) {
    const Eigen::Matrix3d R = T_odom_truth_.R();
    return truth_.walk([&](std::span<const Eigen::Vector3d> block) {
      for (const Eigen::Vector3d& point : block)
        visit(Eigen::Vector3f{(R * point + T_odom_truth_.translation).cast<float>()});
      walked_ += static_cast<double>(block.size());
      progress_(walked_ / (kPasses * static_cast<double>(truth_.points())));
    });
  }

 private:
  static constexpr double kPasses = 3;

  const PointCloudFile& truth_;
  Pose T_odom_truth_;
  const std::function<void(double)>& progress_;
  double walked_ = 0;
};

/// At most so many, evenly taken.
Points some_of(std::span<const Eigen::Vector3f> points, std::size_t most) {
  Points some;
  const std::size_t step = points.size() / most + 1;
  for (std::size_t i = 0; i < points.size(); i += step)
    some.push_back(points[i]);
  return some;
}

Points moved(std::span<const Eigen::Vector3f> points, const Pose& T) {
  Points result;
  for (const Eigen::Vector3f& point : points)
    result.push_back((T * Eigen::Vector3d{point.cast<double>()}).cast<float>());
  return result;
}

MapAccuracy summarised(std::span<const float> distances_m) {
  MapAccuracy accuracy;
  double squares_m2 = 0;
  for (const float distance_m : distances_m) {
    const bool outlier = !(distance_m <= kOutlier_m);
    ++(outlier ? accuracy.outliers : accuracy.compared);
    squares_m2 += outlier ? 0.0 : static_cast<double>(distance_m) * static_cast<double>(distance_m);
  }
  if (accuracy.compared > 0)
    accuracy.rmse_m = std::sqrt(squares_m2 / static_cast<double>(accuracy.compared));
  return accuracy;
}

} // namespace

Expected<MapAccuracy, std::string> map_accuracy(std::span<const Eigen::Vector3f> map_odom, const PointCloudFile& truth,
                                                const Pose& T_truth_odom, const std::function<void(double)>& progress) {
  constexpr std::size_t kMaxIcpPoints = 30'000, kMaxTrueVoxels = 500'000;
  constexpr float kFinest_m = 0.05F;
  TruthWalker walker(truth, T_truth_odom.inverse(), progress);

  ThinnedCloud thinned(kFinest_m, kMaxTrueVoxels);
  if (std::optional<std::string> problem = walker.walk([&](const Eigen::Vector3f& point) { thinned.insert(point); }))
    return *std::move(problem);
  const Points map = moved(map_odom, icp(some_of(map_odom, kMaxIcpPoints), thinned.centroids(), kOutlier_m));

  // Most points have the truth close by, where few others are looked at; the rest are worth a second walk.
  std::vector<float> distances_m(map.size(), std::numeric_limits<float>::infinity());
  for (const float reach_m : {0.25F, kOutlier_m}) {
    Points lost;
    for (std::size_t i = 0; i < map.size(); ++i) {
      if (distances_m[i] > kOutlier_m)
        lost.push_back(map[i]);
    }
    NearestDistances nearest(lost, reach_m);
    if (std::optional<std::string> problem = walker.walk([&](const Eigen::Vector3f& point) { nearest.offer(point); }))
      return *std::move(problem);
    const std::vector<float> found_m = nearest.distances_m();
    std::size_t next = 0;
    for (float& distance_m : distances_m) {
      if (distance_m > kOutlier_m)
        distance_m = found_m[next++];
    }
  }
  return summarised(distances_m);
}

} // namespace locus
