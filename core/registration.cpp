// SPDX-License-Identifier: Apache-2.0
#include "core/registration.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <tbb/info.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <cmath>
#include <vector>

namespace locus {

namespace {

constexpr std::size_t kBlock = 256; ///< points per partial sum, whatever the number of threads

/// Surfaces say nothing along themselves: a variance there that is large against every residual (Segal's 1 to epsilon).
constexpr double kAlongVariance_m2 = 1.0;
constexpr double kPointVariance_m2 = 0.02 * 0.02;

/// Geman-McClure width in standard deviations: begins wide to reach far, halves with each look-up to shut out what does
/// not fit.
constexpr double kWidthStartWide = 40.0;
constexpr double kWidthStart = 12.0;
constexpr double kWidthEnd = 3.0;

constexpr double kConvergedTranslation_m = 5e-4;
constexpr double kConvergedRotation_rad = 5e-5;
constexpr int kStepsPerLookup = 2; ///< Gauss-Newton steps on the same counterparts

/// Counterpart of one source point: a plane of the target.
struct Match {
  Eigen::Vector3d mean_m;
  Eigen::Vector3d normal;
  double variance_m2 = -1.0; ///< negative: none
};

/// Sums over the points of one block.
struct NormalEquations {
  Matrix6 H = Matrix6::Zero();
  Vector6 b = Vector6::Zero();
  Eigen::Matrix3d normals = Eigen::Matrix3d::Zero();
  double error = 0.0;
  double weight = 0.0;
  std::size_t inliers = 0;

  void operator+=(const NormalEquations& other) {
    H += other.H;
    b += other.b;
    normals += other.normals;
    error += other.error;
    weight += other.weight;
    inliers += other.inliers;
  }
};

Match match_of(const SurfaceGrid& grid, VoxelIndex index, const Surface& surface) {
  return {grid.centre_of(index) + surface.mean_m.cast<double>(), surface.normal.cast<double>(),
          static_cast<double>(surface.variance_m2)};
}

/// The plane of the voxel around the point, in the fine grid if it has one, else in the coarse one.
Match find_here(const SurfaceMap& map, const Eigen::Vector3d& point, double max_distance_m) {
  for (const SurfaceGrid* grid : {&map.fine(), &map.coarse()}) {
    const VoxelIndex index = grid->index_of(point);
    const Surface* surface = grid->find(index);
    if (surface == nullptr || !surface->planar())
      continue;
    const Match match = match_of(*grid, index, *surface);
    if (std::abs(match.normal.dot(point - match.mean_m)) < max_distance_m)
      return match;
  }
  return {};
}

/// The plane of the 27 coarse voxels around whose mean is nearest, at most a voxel away.
Match find_around(const SurfaceMap& map, const Eigen::Vector3d& point) {
  const SurfaceGrid& grid = map.coarse();
  const VoxelIndex centre = grid.index_of(point);
  Match nearest;
  double nearest_m2 = grid.leaf_m() * grid.leaf_m();
  for (int i = 0; i < 27; ++i) {
    const VoxelIndex index{centre.x + i % 3 - 1, centre.y + i / 3 % 3 - 1, centre.z + i / 9 - 1};
    const Surface* surface = grid.find(index);
    if (surface == nullptr || !surface->planar())
      continue;
    const Match match = match_of(grid, index, *surface);
    const double distance_m2 = (point - match.mean_m).squaredNorm();
    if (distance_m2 < nearest_m2) {
      nearest_m2 = distance_m2;
      nearest = match;
    }
  }
  return nearest;
}

/// (C_target + C_source)^-1 of two surfaces with covariance I + (variance - 1) n n' along their normals n and m, in
/// closed form: the sum is 2 (I - u n n' - v m m'), inverted after Woodbury. A source without a normal is an isotropic
/// point.
Eigen::Matrix3d information(const Match& match, const Eigen::Vector3d& source_normal) {
  const Eigen::Vector3d& n = match.normal;
  const Eigen::Vector3d& m = source_normal;
  if (m.isZero()) {
    const double along = 1.0 / (kAlongVariance_m2 + kPointVariance_m2);
    const double across = 1.0 / (match.variance_m2 + kPointVariance_m2);
    return along * Eigen::Matrix3d::Identity() + (across - along) * n * n.transpose();
  }
  constexpr double kScale = 2.0 * kAlongVariance_m2;
  const double k_n = kScale / (kAlongVariance_m2 - match.variance_m2) - 1.0;
  const double k_m = kScale / (kAlongVariance_m2 - kPointVariance_m2) - 1.0;
  const double c = n.dot(m);
  const Eigen::Vector3d a = k_m * n + c * m;
  const Eigen::Vector3d b = c * n + k_n * m;
  const double share = 1.0 / (k_n * k_m - c * c);
  return (Eigen::Matrix3d::Identity() + share * (a * n.transpose() + b * m.transpose())) / kScale;
}

/// Takes in one point's share: residual d = R p + t - mean, J = [I, -(R p)x] for a turn about the target's axes.
void linearise(const Eigen::Vector3d& rotated, const Eigen::Vector3d& rotated_normal,
               const Eigen::Vector3d& translation, const Match& match, double width2, NormalEquations& sum) {
  const Eigen::Vector3d d = rotated + translation - match.mean_m;
  const Eigen::Matrix3d M = information(match, rotated_normal);
  const Eigen::Vector3d Md = M * d;
  const double r2 = d.dot(Md);
  const double root = width2 / (width2 + r2);
  const double w = root * root; // Geman-McClure

  const double x = w * rotated.x();
  const double y = w * rotated.y();
  const double z = w * rotated.z();
  Eigen::Matrix3d wMQ; // w M (R p)x
  wMQ.col(0) = z * M.col(1) - y * M.col(2);
  wMQ.col(1) = x * M.col(2) - z * M.col(0);
  wMQ.col(2) = y * M.col(0) - x * M.col(1);
  sum.H.topLeftCorner<3, 3>() += w * M;
  sum.H.topRightCorner<3, 3>() -= wMQ;
  for (int column = 0; column < 3; ++column)
    sum.H.block<3, 1>(3, 3 + column) -= rotated.cross(wMQ.col(column));
  sum.b.head<3>() += w * Md;
  sum.b.tail<3>() += w * rotated.cross(Md);
  sum.normals += w * match.normal * match.normal.transpose();
  sum.error += w * r2;
  sum.weight += w;
  sum.inliers += r2 < width2 ? 1 : 0;
}

} // namespace

struct Gicp::Workers {
  /// No more than there are processors: TBB would not start them, and says so on stderr.
  explicit Workers(int threads) : arena(std::min(threads, tbb::info::default_concurrency())), parallel(threads > 1) {}

  template <class Body> void for_each_block(std::size_t blocks, const Body& body) {
    if (!parallel) {
      for (std::size_t block = 0; block < blocks; ++block)
        body(block);
      return;
    }
    arena.execute([&] { tbb::parallel_for(std::size_t{0}, blocks, body, tbb::simple_partitioner{}); });
  }

  tbb::task_arena
      arena; ///< our own: other users of TBB in the process neither slow us nor are bound by our number of threads
  bool parallel;
  std::vector<Match> matches;
  std::vector<NormalEquations> partial;
};

Gicp::Gicp(int threads) : workers_(std::make_unique<Workers>(threads)) {}
Gicp::~Gicp() = default;

Registration Gicp::align(std::span<const SurfacePoint> source, const SurfaceMap& target, const Pose& T_start,
                         const PosePrior& prior, const RegistrationOptions& options, bool wide,
                         const StopRequested& stop) {
  Registration result;
  result.T_target_source = T_start;
  const std::size_t blocks = (source.size() + kBlock - 1) / kBlock;
  workers_->matches.resize(std::max(workers_->matches.size(), source.size()));
  workers_->partial.resize(std::max(workers_->partial.size(), blocks));
  double width = wide ? kWidthStartWide : kWidthStart;

  while (result.iterations < options.max_iterations && (result.iterations == 0 || !stop())) {
    const bool look_up = result.iterations % kStepsPerLookup == 0;
    if (look_up && result.iterations > 0)
      width = std::max(0.5 * width, kWidthEnd);
    const bool around = wide && width > kWidthStart;
    const Pose& T = result.T_target_source;
    const Eigen::Matrix3d R = T.R();
    workers_->for_each_block(blocks, [&](std::size_t block) {
      NormalEquations sum;
      for (std::size_t i = block * kBlock; i < std::min(source.size(), (block + 1) * kBlock); ++i) {
        const Eigen::Vector3d rotated = R * source[i].position_m.cast<double>();
        Match& match = workers_->matches[i];
        if (look_up) {
          const Eigen::Vector3d point = rotated + T.translation;
          match = around ? find_around(target, point) : find_here(target, point, options.max_correspondence_m);
        }
        if (match.variance_m2 > 0.0)
          linearise(rotated, R * source[i].normal.cast<double>(), T.translation, match, width * width, sum);
      }
      workers_->partial[block] = sum;
    });
    NormalEquations total;
    for (std::size_t block = 0; block < blocks; ++block)
      total += workers_->partial[block];
    if (total.weight <= 0.0)
      break;
    total.H.bottomLeftCorner<3, 3>() = total.H.topRightCorner<3, 3>().transpose();

    Vector6 from_prior;
    from_prior << T.translation - prior.T_target_source.translation,
        so3_log(T.rotation * prior.T_target_source.rotation.conjugate());
    const Matrix6 H = total.H + prior.information + 1e-6 * Matrix6::Identity();
    const Vector6 step = -H.ldlt().solve(total.b + prior.information * from_prior);
    if (!step.allFinite())
      break;
    result.T_target_source.translation += step.head<3>();
    result.T_target_source.rotation = (so3_exp(step.tail<3>()) * T.rotation).normalized();
    ++result.iterations;
    result.inliers = total.inliers;
    result.mean_error = total.error / total.weight;
    result.information = total.H;
    result.observability =
        Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(total.normals / total.weight, Eigen::EigenvaluesOnly)
            .eigenvalues();
    result.converged = look_up && width <= kWidthEnd && step.head<3>().norm() < kConvergedTranslation_m &&
                       step.tail<3>().norm() < kConvergedRotation_rad;
    if (result.converged)
      break;
  }
  return result;
}

} // namespace locus
