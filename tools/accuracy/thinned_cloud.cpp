// SPDX-License-Identifier: Apache-2.0
#include "accuracy/thinned_cloud.hpp"

#include <utility>

#include "accuracy/voxel_key.hpp"

namespace locus {

void ThinnedCloud::insert(const Eigen::Vector3f& position) {
  Voxel& voxel = voxels_[voxel_key(position, side_m_)];
  voxel.sum_m += position.cast<double>();
  ++voxel.points;
  if (voxels_.size() > max_voxels_)
    coarsen();
}

void ThinnedCloud::coarsen() {
  side_m_ *= 2;
  const auto fine = std::exchange(voxels_, {});
  for (const auto& [key, voxel] : fine) {
    Voxel& whole = voxels_[voxel_key(voxel.centroid(), side_m_)];
    whole.sum_m += voxel.sum_m;
    whole.points += voxel.points;
  }
}

std::vector<Eigen::Vector3f> ThinnedCloud::centroids() const {
  std::vector<Eigen::Vector3f> centroids;
  for (const auto& [key, voxel] : voxels_)
    centroids.push_back(voxel.centroid());
  return centroids;
}

} // namespace locus
