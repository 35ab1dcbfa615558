// SPDX-License-Identifier: Apache-2.0
#include "accuracy/map_accuracy.hpp"

#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "accuracy/icp.hpp"
#include "accuracy/nearest_distances.hpp"
#include "accuracy/thinned_cloud.hpp"

namespace locus {
namespace {

using Points = std::vector<Eigen::Vector3f>;

constexpr float kOutlier_m = 1.0F; ///< as in the contract
constexpr float kFinestVoxel_m = 0.05F;
constexpr std::size_t kMaxIcpPoints = 30'000;   ///< of the map
constexpr std::size_t kMaxTrueVoxels = 200'000; ///< of the truth: 20 MB in total

/// Walks through the true points in the frame of the map, where coordinates are small enough for floats; repeatable.
class TruthWalker {
 public:
  TruthWalker(const PointCloudFile& truth, Pose T_odom_truth, const std::function<void(double)>& progress)
      : truth_(truth), T_odom_truth_(std::move(T_odom_truth)), progress_(progress) {}

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

Expected<Points, std::string> thinned_truth(TruthWalker& truth) {
  ThinnedCloud thinned(kFinestVoxel_m, kMaxTrueVoxels);
  if (std::optional<std::string> problem = truth.walk([&](const Eigen::Vector3f& point) { thinned.insert(point); }))
    return *std::move(problem);
  return thinned.centroids();
}

/// Returns at most this many points, evenly sampled.
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

/// Computes the distance from each point of the map to the nearest true one; infinite beyond a metre. Most points have
/// a close neighbour, which a narrow search finds at low cost; only the rest need a wider one.
Expected<std::vector<float>, std::string> distances_to(TruthWalker& truth, const Points& map) {
  std::vector<float> distances_m(map.size(), std::numeric_limits<float>::infinity());
  for (const float reach_m : {0.25F, kOutlier_m}) {
    Points lost;
    for (std::size_t i = 0; i < map.size(); ++i) {
      if (std::isinf(distances_m[i]))
        lost.push_back(map[i]);
    }
    NearestDistances nearest(lost, reach_m);
    if (std::optional<std::string> problem = truth.walk([&](const Eigen::Vector3f& point) { nearest.offer(point); }))
      return *std::move(problem);
    const std::vector<float> found_m = nearest.distances_m();
    auto found = found_m.begin();
    for (float& distance_m : distances_m) {
      if (std::isinf(distance_m))
        distance_m = *found++;
    }
  }
  return distances_m;
}

MapAccuracy summary_of(std::span<const float> distances_m) {
  MapAccuracy accuracy;
  double squares_m2 = 0;
  for (const float distance_m : distances_m) {
    ++(std::isinf(distance_m) ? accuracy.outliers : accuracy.compared);
    if (!std::isinf(distance_m))
      squares_m2 += static_cast<double>(distance_m) * static_cast<double>(distance_m);
  }
  if (accuracy.compared > 0)
    accuracy.rmse_m = std::sqrt(squares_m2 / static_cast<double>(accuracy.compared));
  return accuracy;
}

} // namespace

Expected<MapAccuracy, std::string> map_accuracy(std::span<const Eigen::Vector3f> map_odom, const PointCloudFile& truth,
                                                const Pose& T_truth_odom, const std::function<void(double)>& progress) {
  TruthWalker walker(truth, T_truth_odom.inverse(), progress);
  const Expected<Points, std::string> thinned = thinned_truth(walker);
  if (!thinned)
    return thinned.error();
  const Pose T_fitted_map = icp(some_of(map_odom, kMaxIcpPoints), *thinned, static_cast<double>(kOutlier_m));
  const Expected<std::vector<float>, std::string> distances_m = distances_to(walker, moved(map_odom, T_fitted_map));
  if (!distances_m)
    return distances_m.error();
  return summary_of(*distances_m);
}

} // namespace locus
