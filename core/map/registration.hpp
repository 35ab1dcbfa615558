// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
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

inline constexpr std::size_t kGicpBlock = 256; ///< points per partial sum, whatever the number of threads

/// Vector of pose at the end of a sweep and mean twist during it: translation and rotation of the pose along the
/// target's axes, then the twist along the axes of the base.
using Vector12 = Eigen::Matrix<double, 12, 1>;
using Matrix12 = Eigen::Matrix<double, 12, 12>;

/// Points of a sweep recorded while the base moved. They are de-skewed to the end of the sweep for `twist_base`; for
/// another twist each point moves according to its age.
struct ElasticScan {
  std::span<const SurfacePoint> points{}; ///< sorted by age, so that those of a block of kGicpBlock are of similar age
  std::span<const float> age_s{};         ///< of each point; empty: all are zero
  Vector6 twist_base = Vector6::Zero();   ///< m/s and rad/s
  std::optional<bool> shapeless{};        ///< voxels without a plane serve as correspondences; empty: if planes are few
};

/// Gaussian prior of pose and twist.
struct MotionBelief {
  Pose T_target_source;
  Vector6 twist_base = Vector6::Zero();
  Matrix12 information = Matrix12::Zero(); ///< zero: no information about an axis
};

inline constexpr std::size_t kObjects = 512; ///< elements of Registration::object_costs

/// Outcome of a registration.
struct Registration {
  Pose T_target_source;
  Vector6 twist_base = Vector6::Zero();
  bool shapeless = false;                  ///< voxels without a plane served as correspondences, too
  bool converged = false;                  ///< the last step was below the thresholds
  int iterations = 0;                      ///< Gauss-Newton steps
  std::size_t points = 0;                  ///< number of points of the scan
  std::size_t inliers = 0;                 ///< points with a correspondence within reach
  std::size_t planes = 0;                  ///< inliers whose correspondence is a plane
  std::size_t unknown = 0;                 ///< points in space occupied by a surface of unknown shape
  double mean_error = 0.0;                 ///< mean squared Mahalanobis distance of the inliers
  Matrix12 information = Matrix12::Zero(); ///< of the points alone, scaled for their correlation
  /// Twice the negative log likelihood of the points of each object, see evidence(). An object is what stands on a
  /// square metre around the robot; a few share an element.
  std::array<float, kObjects> object_costs{};
  /// Mean over the points of v v', v = (n, p x n): n the unit normal of the correspondence, p the point in m about the
  /// source's origin. Measures how well the surfaces constrain each direction. Target axes.
  Matrix6 observability = Matrix6::Zero();

  /// Returns the share of the points that lie where the target has points, too.
  [[nodiscard]] double overlap() const {
    return points > 0 ? static_cast<double>(inliers + unknown) / static_cast<double>(points) : 0.0;
  }
};

/// Returns the score of a registration: the sum over its inliers, each worth more the nearer it lies to its surface. A
/// point without a correspondence counts as one at three standard deviations. Among registrations of the same points
/// the larger score is better.
double fit_of(const Registration& registration);

/// Returns whether the points lie about their surfaces as any points would: a uniform density within reach of the
/// surfaces is as likely as that of points measured on them.
bool is_spread_evenly(const Registration& registration);

/// Evidence of each object for one hypothesis against another: twice a log likelihood ratio. May be summed over sweeps.
using ObjectEvidence = std::array<float, kObjects>;

/// Compares two registrations of the same points, object by object, scaled for the correlation of points. Positive
/// where an object fits `one` better.
///
/// Model of a point: a mixture. It lies on a surface of the map (squared Mahalanobis distance), or in unmapped space
/// (uniform). The share of mapped points is the maximum likelihood one for each registration: where little is mapped, a
/// pose that slides the scan back onto the map gains nothing.
ObjectEvidence compare(const Registration& one, const Registration& other);

/// Returns the evidence of all objects. Each may have moved, so that all of its points together, in however many
/// sweeps, are worth no more than the odds against that, whichever hypothesis they speak for.
double total(const ObjectEvidence& evidence);

/// Returns the evidence for `one` against `other`.
double evidence(const Registration& one, const Registration& other);

/// Generalised ICP (Segal 2009; paper equations 1 and 2): aligns points that have surface covariances with a map of
/// surfaces.
///
/// Minimises the sum of robust d' (C_target + R C_source R')^-1 d by Gauss-Newton over the pose at the end of the sweep
/// and the twist during it; a plane constrains its normal only. The Jacobian of a point of age a with respect to the
/// twist is -a times that with respect to the pose, a the mean age of its block; with each search for correspondences
/// the points move with the twist by their own ages. One pass over the points finds the correspondences and sums the
/// normal equations. The sums are taken over fixed blocks of points in a fixed order: same input, same bits, for any
/// number of threads. One owner.
class Gicp {
 public:
  using StopRequested = std::function<bool()>; ///< polled between iterations; true stops after at least one iteration

  explicit Gicp(int threads, Isa isa = best_isa());
  ~Gicp();
  Gicp(const Gicp&) = delete;
  Gicp& operator=(const Gicp&) = delete;

  /// Registers `source` with `target`, starting from `T_start` and the twist of the scan. `wide` first searches all
  /// voxels around each point, for a start that may be off by more than a voxel. Never throws; without correspondences
  /// the result is the start, not converged.
  Registration align(const ElasticScan& source, const SurfaceMap& target, const Pose& T_start,
                     const MotionBelief& prior, const RegistrationOptions& options, bool wide,
                     const StopRequested& stop);

 private:
  struct Workers;
  std::unique_ptr<Workers> workers_;
};

} // namespace locus
