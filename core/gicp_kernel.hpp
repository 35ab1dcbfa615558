// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <span>

#include "core/isa.hpp"
#include "core/pose.hpp"
#include "core/surface_map.hpp"

namespace locus {

/// Counterpart of one source point: a plane of the target, or the Gaussian of a shapeless voxel.
struct Match {
  Eigen::Vector3d mean_m;
  Eigen::Vector3d normal;    ///< zero for a shapeless one
  double variance_m2 = -1.0; ///< along the normal, or in every direction; negative: no counterpart
};

/// Sums over the points of one block.
struct NormalEquations {
  Matrix6 H = Matrix6::Zero();
  Vector6 b = Vector6::Zero();
  Eigen::Matrix3d normals = Eigen::Matrix3d::Zero();
  double error = 0.0;
  double weight = 0.0;
  std::size_t planes = 0; ///< points whose counterpart is a plane
  std::size_t inliers = 0;

  void operator+=(const NormalEquations& other) {
    H += other.H;
    b += other.b;
    normals += other.normals;
    error += other.error;
    weight += other.weight;
    planes += other.planes;
    inliers += other.inliers;
  }
};

/// How counterparts come about in a pass.
enum class LookUp {
  keep,   ///< those of the pass before
  here,   ///< the plane of the voxel around the point, fine or else coarse
  around, ///< the nearest plane of the 27 voxels around it, fine or else coarse
};

/// One pass over some of the points: finds their counterparts and sums the normal equations at T = (R, t).
struct GicpPass {
  const SurfaceMap& target;
  Eigen::Matrix3d R;
  Eigen::Vector3d t;
  LookUp look_up;
  bool takes_shapeless;        ///< voxels without a plane serve, too
  double max_correspondence_m; ///< across the plane
  double width2;               ///< of Geman-McClure, squared standard deviations
};

/// `matches` has the size of `points`; read or written as the pass says. Pure but for that; any thread. The result
/// depends on the instruction set in its last digits.
NormalEquations linearise(const GicpPass& pass, std::span<const SurfacePoint> points, std::span<Match> matches,
                          Isa isa);

} // namespace locus
