// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>

#include "core/base/isa.hpp"
#include "core/base/pose.hpp"
#include "core/map/correspondences.hpp"

namespace locus {

/// Sums over the points of one block.
struct NormalEquations {
  Matrix6 H = Matrix6::Zero();
  Vector6 b = Vector6::Zero();
  /// Values along the axes of the pass and about those of the target: `observed` is the information without the part
  /// that noise of the normals alone produces, `sides` what an error of one metre common to all points, each with the
  /// worse sign, adds to b.
  Vector6 observed = Vector6::Zero(), sides = Vector6::Zero();
  double error = 0.0;
  double weight = 0.0;
  std::size_t planes = 0; ///< points whose correspondence is a plane
  std::size_t inliers = 0;

  void operator+=(const NormalEquations& other) {
    H += other.H;
    b += other.b;
    observed += other.observed;
    sides += other.sides;
    error += other.error;
    weight += other.weight;
    planes += other.planes;
    inliers += other.inliers;
  }
};

/// Fit of each point of a block in the last pass.
struct FitBlock {
  PerPoint error;  ///< squared Mahalanobis distance times its robust weight
  PerPoint mapped; ///< 1 for an inlier, else 0
};

/// Sums the normal equations, and sets `fit`. Pure; any thread. The last digits depend on the instruction set.
NormalEquations linearise(const GicpPass& pass, const SourceBlock& source, const MatchBlock& matches, Isa isa,
                          FitBlock& fit);

/// Number of points of a block with a correspondence, and the scatter of its normals; a shapeless one counts as a third
/// of a plane along each axis.
struct Normals {
  Eigen::Matrix3d squares = Eigen::Matrix3d::Zero(); ///< sum of n n'
  double points = 0.0;

  void operator+=(const Normals& other) {
    squares += other.squares;
    points += other.points;
  }
};
Normals normals_of(const MatchBlock& matches, Isa isa);

/// Sums (n, R p x n) (n, R p x n)' over the points of a block: gradients of the distances to the correspondences with
/// respect to the pose. Normals have unit length, so the sum measures where surfaces are, not how well they are known.
/// Shapeless correspondences count as in normals_of().
Matrix6 gradients_of(const Eigen::Matrix3d& R_target_source, const SourceBlock& source, const MatchBlock& matches,
                     Isa isa);

} // namespace locus
