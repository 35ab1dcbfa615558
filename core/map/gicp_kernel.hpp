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
  /// Along the axes of the pass and about those of the target: the information without what only noise of the normals
  /// makes of it, and what an error of a metre that all points have in common, each to the worse side, adds to b.
  Vector6 seen = Vector6::Zero(), sides = Vector6::Zero();
  double error = 0.0;
  double weight = 0.0;
  std::size_t planes = 0; ///< points whose correspondence is a plane
  std::size_t inliers = 0;

  void operator+=(const NormalEquations& other) {
    H += other.H;
    b += other.b;
    seen += other.seen;
    sides += other.sides;
    error += other.error;
    weight += other.weight;
    planes += other.planes;
    inliers += other.inliers;
  }
};

/// Sums up the normal equations. Pure; any thread. The result depends on the instruction set in its last digits.
NormalEquations linearise(const GicpPass& pass, const SourceBlock& source, const MatchBlock& matches, Isa isa);

/// How many of the points of a block have a correspondence, and which way it faces; a shapeless one counts as a third
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

/// Sum over the points of a block of (n, R p x n) with itself: how distances to the correspondences change with the
/// pose. Of unit normals, so it tells where surfaces stand and not how well they are known. Counts as normals_of().
Matrix6 gradients_of(const Eigen::Matrix3d& R_target_source, const SourceBlock& source, const MatchBlock& matches,
                     Isa isa);

} // namespace locus
