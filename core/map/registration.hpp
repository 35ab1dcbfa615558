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

inline constexpr std::size_t kGicpBlock = 256; ///< points that are summed up together, whatever the number of threads

/// Pose at the end of a sweep and twist while it came in: translation and turn of the pose along the target's axes,
/// then the twist along the axes of the base.
using Vector12 = Eigen::Matrix<double, 12, 1>;
using Matrix12 = Eigen::Matrix<double, 12, 12>;

/// Points of a sweep that came in while the base moved. They lie where they were seen from its end if the twist was
/// `twist_base`; a point of another twist lies, by its age, elsewhere.
struct ElasticScan {
  std::span<const SurfacePoint> points{}; ///< by age
  std::span<const float> block_age_s{};   ///< mean of each kGicpBlock points; empty: all are of the end
  Vector6 twist_base = Vector6::Zero();   ///< m/s and rad/s
};

/// What is known before a look at the points: a Gaussian.
struct MotionBelief {
  Pose T_target_source;
  Vector6 twist_base = Vector6::Zero();
  Matrix12 information = Matrix12::Zero(); ///< zero says nothing about an axis
};

/// Outcome of a registration.
struct Registration {
  Pose T_target_source;
  Vector6 twist_base = Vector6::Zero();
  bool converged = false;                  ///< the last step was below the thresholds
  int iterations = 0;                      ///< Gauss-Newton steps
  std::size_t points = 0;                  ///< of the scan
  std::size_t inliers = 0;                 ///< points with a correspondence within reach
  double mean_error = 0.0;                 ///< mean squared Mahalanobis distance of the inliers
  Matrix12 information = Matrix12::Zero(); ///< of the points alone, as far as they are independent
  /// Mean over the points of (n, p x n) with itself, n the unit normal of the correspondence, p the point in m about
  /// the source's origin: what the surfaces around allow to be seen. Target axes.
  Matrix6 observability = Matrix6::Zero();

  /// Returns the share of the points that have a correspondence.
  [[nodiscard]] double overlap() const {
    return points > 0 ? static_cast<double>(inliers) / static_cast<double>(points) : 0.0;
  }
};

/// How well a registration fits: the points with a correspondence, each worth the more the nearer it lies. One without
/// counts as one that is three standard deviations off. Of registrations of the same points the larger is the better.
double fit_of(const Registration& registration);

/// Twice the log likelihood ratio of two registrations of the same points, scaled to the points that are independent.
///
/// Model of a point: a mixture. It lies on a surface of the map (its squared Mahalanobis distance counts), or in space
/// that is not mapped (uniform). The share of mapped points is the most likely one for each registration: where little
/// is mapped, a pose that slides the scan back onto the map gains nothing.
double evidence(const Registration& one, const Registration& other);

/// Generalised ICP (Segal 2009; paper equations 1 and 2): aligns points that have surface covariances with a map of
/// surfaces.
///
/// Minimises the sum of robust d' (C_target + R C_source R')^-1 d, a plane being known along its normal alone, by
/// Gauss-Newton over the pose at the end of the sweep
/// and the twist during it. A point of age a moves with the twist by -a times what it moves with the pose; a block of
/// points has one age. One pass over the points finds the correspondences and sums the normal equations. The sums are
/// taken over fixed blocks of points in a fixed order: same input, same bits, for any number of threads. One owner.
class Gicp {
 public:
  using StopRequested = std::function<bool()>; ///< asked between iterations; true ends the work with what is there, one
                                               ///< iteration at the least

  explicit Gicp(int threads, Isa isa = best_isa());
  ~Gicp();
  Gicp(const Gicp&) = delete;
  Gicp& operator=(const Gicp&) = delete;

  /// Begins at `T_start` with the twist of the scan. `wide` first looks for correspondences all around each point, for
  /// a start that may be off by more than a voxel. Never throws; without correspondences the result is the start, not
  /// converged.
  Registration align(const ElasticScan& source, const SurfaceMap& target, const Pose& T_start,
                     const MotionBelief& prior, const RegistrationOptions& options, bool wide,
                     const StopRequested& stop);

 private:
  struct Workers;
  std::unique_ptr<Workers> workers_;
};

} // namespace locus
