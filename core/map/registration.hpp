// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <functional>
#include <memory>
#include <optional>
#include <span>

#include "core/base/isa.hpp"
#include "core/base/options.hpp"
#include "core/base/pose.hpp"
#include "core/map/surface_map.hpp"

namespace locus {

/// What is known of T_target_source before looking at the points: a Gaussian on SE(3).
struct PosePrior {
  Pose T_target_source;
  /// Of (translation, rotation about the target's axes) errors; zero says nothing about an axis.
  Matrix6 information = Matrix6::Zero();
};

/// Outcome of a registration.
struct Registration {
  Pose T_target_source;
  bool converged = false;                ///< the last step was below the thresholds
  int iterations = 0;                    ///< Gauss-Newton steps
  std::size_t inliers = 0;               ///< points with a correspondence within reach
  double mean_error = 0.0;               ///< mean squared Mahalanobis distance of the inliers
  Matrix6 information = Matrix6::Zero(); ///< of the points alone, without the prior; order and frame as in PosePrior
  /// Mean over the points of (n, p x n) with itself, n the unit normal of the correspondence, p the point in m about
  /// the source's origin: what the surfaces around allow to be seen. Target axes.
  Matrix6 observability = Matrix6::Zero();
};

/// Generalised ICP (Segal 2009; paper equations 1 and 2): aligns points that have surface covariances with a map of
/// surfaces.
///
/// Minimises the sum of robust d' (C_target + R C_source R')^-1 d by Gauss-Newton on SE(3). One pass over the points
/// finds the correspondences and sums the normal equations. The sums are taken over fixed blocks of points in a fixed
/// order: same input, same bits, for any number of threads. One owner.
class Gicp {
 public:
  using StopRequested = std::function<bool()>; ///< asked between iterations; true ends the work with what is there, one
                                               ///< iteration at the least

  explicit Gicp(int threads, Isa isa = best_isa());
  ~Gicp();
  Gicp(const Gicp&) = delete;
  Gicp& operator=(const Gicp&) = delete;

  /// Begins at `T_start`. `wide` first looks for correspondences all around each point, for a start that may be off by
  /// more than a voxel. Never throws; without correspondences the result is the start, not converged.
  Registration align(std::span<const SurfacePoint> source, const SurfaceMap& target, const Pose& T_start,
                     const PosePrior& prior, const RegistrationOptions& options, bool wide, const StopRequested& stop);

 private:
  struct Workers;
  std::unique_ptr<Workers> workers_;
};

} // namespace locus
