// SPDX-License-Identifier: Apache-2.0
#include "core/map/registration.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <tbb/info.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <vector>

#include "core/map/gicp_kernel.hpp"

namespace locus {

namespace {

/// Where fewer of the points than this find a plane, as in a thicket, shapeless voxels serve as well. Elsewhere they
/// would only tie the robot to where the scan lines fell.
constexpr double kFewPlanes = 0.4;

constexpr double kDamping = 1e-6; ///< keeps directions solvable that neither points nor prior know

/// Geman-McClure width in standard deviations: begins wide to reach far, narrows with each look-up to shut out what
/// does not fit.
constexpr double kWidthStartWide = 80.0;
constexpr double kWidthStart = 12.0;
constexpr double kWidthEnd = 3.5;
constexpr double kNarrowing = 0.25;

constexpr double kConvergedTranslation_m = 1e-3;
constexpr double kConvergedRotation_rad = 1e-4;
constexpr int kStepsPerLookUp = 2; ///< Gauss-Newton steps on the same correspondences

/// Where fewer than this share of the normals points, there is next to nothing to hold on to.
constexpr double kFewNormals = 0.01;

WeakDirections weak_directions(const Normals& normals) {
  Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> axes;
  axes.computeDirect(normals.squares / std::max(normals.points, 1.0));
  WeakDirections weak;
  for (int axis = 0; axis < 2 && axes.eigenvalues()[axis] < kFewNormals; ++axis)
    weak.unit[weak.count++] = axes.eigenvectors().col(axis).cast<float>();
  return weak;
}

/// What the gradients of the points count for. A handful of points is not a hundredth of a crowd: along a weak
/// direction there are no others to be checked against, and what is wrong with them comes again with every sweep.
Matrix6 belief(const WeakDirections& weak, const Normals& normals) {
  Matrix6 belief = Matrix6::Identity();
  for (const Eigen::Vector3f& unit : std::span(weak.unit).first(weak.count)) {
    const Eigen::Vector3d along = unit.cast<double>();
    const double share = along.dot(normals.squares * along) / std::max(normals.points, 1.0);
    belief.topLeftCorner<3, 3>() -= std::max(0.0, 1.0 - share / kFewNormals) * along * along.transpose();
  }
  return belief;
}

} // namespace

struct Gicp::Workers {
  /// No more than there are processors: TBB would not start them, and says so on stderr.
  Workers(int threads, Isa with_isa)
      : arena(std::min(threads, tbb::info::default_concurrency())), parallel(threads > 1), isa(with_isa) {}

  template <class Body> void for_each_block(const Body& body) {
    if (!parallel) {
      for (std::size_t block = 0; block < blocks.size(); ++block)
        body(block);
      return;
    }
    arena.execute([&] { tbb::parallel_for(std::size_t{0}, blocks.size(), body, tbb::simple_partitioner{}); });
  }

  void take(std::span<const SurfacePoint> source) {
    blocks.clear();
    for (std::size_t begin = 0; begin < source.size(); begin += kGicpBlock)
      blocks.emplace_back(source.subspan(begin, std::min(kGicpBlock, source.size() - begin)));
    matches.resize(std::max(matches.size(), blocks.size()));
    partial.resize(std::max(partial.size(), blocks.size()));
  }

  /// One pass over all points, block by block in a fixed order of summation.
  NormalEquations run(const GicpPass& pass) {
    if (pass.look_up != LookUp::keep)
      look_up(pass);
    for_each_block([&](std::size_t block) { partial[block] = linearise(pass, blocks[block], matches[block], isa); });
    NormalEquations total;
    for (std::size_t block = 0; block < blocks.size(); ++block)
      total += partial[block];
    total.H = believed * total.H * believed;
    total.b = believed * total.b;
    return total;
  }

  void look_up(const GicpPass& pass) {
    for_each_block([&](std::size_t block) { find(pass, blocks[block], matches[block], isa); });
    const WeakDirections weak = weak_directions(normals());
    for (std::size_t block = 0; block < blocks.size() && weak.count > 0; ++block)
      straighten(weak, matches[block]);
    straightened = weak.count > 0;
    believed = straightened ? belief(weak, normals()) : Matrix6::Identity();
  }

  [[nodiscard]] Normals normals() const {
    Normals total;
    for (std::size_t block = 0; block < blocks.size(); ++block)
      total += normals_of(matches[block], isa);
    return total;
  }

  [[nodiscard]] Matrix6 observability(const Eigen::Matrix3d& R_target_source) const {
    Matrix6 gradients = Matrix6::Zero();
    for (std::size_t block = 0; block < blocks.size(); ++block)
      gradients += gradients_of(R_target_source, blocks[block], matches[block], isa);
    return gradients / std::max(normals().points, 1.0);
  }

  /// Our own: other users of TBB in the process neither slow us nor are bound by our number of threads.
  tbb::task_arena arena;
  bool parallel;
  Isa isa;
  std::vector<SourceBlock> blocks;
  std::vector<MatchBlock> matches;
  std::vector<NormalEquations> partial;
  bool straightened = false; ///< the matches
  Matrix6 believed = Matrix6::Identity();
};

Gicp::Gicp(int threads, Isa isa) : workers_(std::make_unique<Workers>(threads, isa)) {}
Gicp::~Gicp() = default;

namespace {

/// Gauss-Newton step from T, in (translation, turn about the target's axes).
Vector6 solve(const NormalEquations& points, const Pose& T, const PosePrior& prior) {
  Vector6 from_prior;
  from_prior << T.translation - prior.T_target_source.translation,
      so3_log(T.rotation * prior.T_target_source.rotation.conjugate());
  const Matrix6 H = points.H + prior.information + kDamping * Matrix6::Identity();
  return -H.ldlt().solve(points.b + prior.information * from_prior);
}

void describe(const NormalEquations& points, Registration& result) {
  result.inliers = points.inliers;
  result.mean_error = points.error / points.weight;
  result.information = points.H;
}

bool is_small(const Vector6& step) {
  return step.head<3>().norm() < kConvergedTranslation_m && step.tail<3>().norm() < kConvergedRotation_rad;
}

} // namespace

Registration Gicp::align(std::span<const SurfacePoint> source, const SurfaceMap& target, const Pose& T_start,
                         const PosePrior& prior, const RegistrationOptions& options, bool wide,
                         const StopRequested& stop) {
  Registration result;
  result.T_target_source = T_start;
  if (!T_start.finite() || !target.reaches(T_start.translation))
    return result;
  workers_->take(source);
  double width = wide ? kWidthStartWide : kWidthStart;
  bool few_planes = false;
  bool can_follow = false;
  while (result.iterations < options.max_iterations && (result.iterations == 0 || !stop())) {
    const Pose& T = result.T_target_source;
    const bool looks_up = result.iterations % kStepsPerLookUp == 0;
    if (looks_up && result.iterations > 0)
      width = std::max(kNarrowing * width, kWidthEnd);
    const LookUp anew = wide && width > kWidthStart ? LookUp::around : can_follow ? LookUp::follow : LookUp::here;
    const NormalEquations points = workers_->run({target, T, T_start.translation, looks_up ? anew : LookUp::keep,
                                                  few_planes, options.max_correspondence_m, width * width});
    if (!(points.weight > 0.0))
      break;
    if (looks_up)
      can_follow = anew != LookUp::around && !workers_->straightened;
    if (!few_planes && static_cast<double>(points.planes) < kFewPlanes * static_cast<double>(source.size())) {
      few_planes = true;
      can_follow = false;
    }
    const Vector6 step = solve(points, T, prior);
    if (!step.allFinite())
      break;
    describe(points, result);
    result.T_target_source = {(so3_exp(step.tail<3>()) * T.rotation).normalized(), T.translation + step.head<3>()};
    ++result.iterations;
    result.converged = looks_up && width <= kWidthEnd && is_small(step);
    if (result.converged)
      break;
  }
  if (result.iterations > 0)
    result.observability = workers_->observability(result.T_target_source.R());
  return result;
}

} // namespace locus
