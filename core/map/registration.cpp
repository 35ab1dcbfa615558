// SPDX-License-Identifier: Apache-2.0
#include "core/map/registration.hpp"

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <tbb/info.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <vector>

#include "core/map/elastic_equations.hpp"
#include "core/map/gicp_kernel.hpp"

namespace locus {

namespace {

/// Share of points with a plane below which voxels without one serve as correspondences as well, as in a thicket.
/// Elsewhere they would only tie the robot to the pattern of the scan lines.
constexpr double kFewPlanes = 0.4;

constexpr double kDamping = 1e-6; ///< regularises directions that neither points nor prior constrain

/// Geman-McClure width in standard deviations: starts wide for a large basin of convergence, and narrows with each
/// search for correspondences to reject outliers.
constexpr double kWidthStartWide = 80.0;
constexpr double kWidthStart = 12.0;
constexpr double kWidthEnd = 3.5;
constexpr double kNarrowing = 0.25;

/// Squared Mahalanobis distance at which a point is as likely in unmapped space as on a surface: 2 ln(L / sqrt(2 pi)),
/// with unmapped space as long as 20 standard deviations of a surface (1 m and 5 cm).
constexpr double kUnmapped = 4.2;
/// Mean squared Mahalanobis distance at which points are as likely anywhere within kWidthEnd of a surface as on it:
/// 2 ln(2 kWidthEnd / sqrt(2 pi)).
constexpr double kAnywhere = 2.05;
/// Odds, as twice their logarithm, that an object is where the map has it: one of twenty has moved.
constexpr double kObjectIsStatic = 6.0;

constexpr double kConvergedTranslation_m = 1e-3;
constexpr double kConvergedRotation_rad = 1e-4;
constexpr int kStepsPerLookUp = 2; ///< Gauss-Newton steps on the same correspondences

Axes axes_of(const Normals& normals) {
  Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver;
  solver.computeDirect(normals.squares / std::max(normals.points, 1.0));
  Axes axes;
  for (std::size_t axis = 0; axis < axes.size(); ++axis)
    Eigen::Vector3f::Map(axes[axis].data()) = solver.eigenvectors().col(static_cast<Eigen::Index>(axis)).cast<float>();
  return axes;
}

/// Returns the element of Registration::object_costs for a point, by a hash of the square metre on which it stands.
std::size_t object_at(float x_m, float y_m) {
  const auto column = static_cast<std::uint32_t>(static_cast<std::int32_t>(std::floor(x_m)));
  const auto row = static_cast<std::uint32_t>(static_cast<std::int32_t>(std::floor(y_m)));
  return ((column * 73856093U) ^ (row * 19349663U)) % kObjects;
}

/// Returns the block that begins at `begin`; empty beyond the end.
template <class T> std::span<const T> block_at(std::size_t begin, std::span<const T> all) {
  const std::span<const T> rest = all.subspan(std::min(begin, all.size()));
  return rest.first(std::min(kGicpBlock, rest.size()));
}

} // namespace

struct Gicp::Workers {
  /// At most one thread per processor: TBB would not start more, and warns on stderr.
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

  void set_source(const ElasticScan& source) {
    blocks.clear();
    for (std::size_t begin = 0; begin < source.points.size(); begin += kGicpBlock)
      blocks.emplace_back(block_at(begin, source.points), block_at(begin, source.age_s));
    matches.resize(std::max(matches.size(), blocks.size()));
    fits.assign(blocks.size(), {});
    partial.resize(std::max(partial.size(), blocks.size()));
    twist_of_scan = source.twist_base;
  }

  /// Returns the pose of a block's frame in the target, for a base that moved with `twist_base`.
  [[nodiscard]] Pose place(std::size_t block, const Pose& T_target_source, const Vector6& twist_base) const {
    const double age_s = blocks[block].age_s;
    if (age_s == 0.0)
      return T_target_source;
    return T_target_source * se3_exp(-age_s * twist_base) * se3_exp(age_s * twist_of_scan);
  }

  /// Runs one pass over all points, block by block in a fixed order of summation.
  ElasticEquations run(GicpPass pass, const Vector6& twist_base) {
    const auto of = [&](std::size_t block) {
      GicpPass of_block = pass;
      of_block.T_target_source = place(block, pass.T_target_source, twist_base);
      return of_block;
    };
    if (pass.look_up != LookUp::reuse) {
      for_each_block([&](std::size_t block) {
        blocks[block].deskew(twist_base - twist_of_scan);
        find(of(block), blocks[block], matches[block], isa);
      });
      axes = axes_of(normals());
    }
    pass.axes = axes;
    for_each_block([&](std::size_t block) {
      const GicpPass of_block = of(block);
      partial[block] = linearise(of_block, blocks[block], matches[block], isa, fits[block]);
    });
    const Matrix6 R_target_base = turn_both(pass.T_target_source.rotation);
    ElasticEquations total;
    for (std::size_t block = 0; block < blocks.size(); ++block)
      total.add(partial[block], blocks[block].age_s, R_target_base);
    total.complete(pass.axes, R_target_base);
    return total;
  }

  [[nodiscard]] Normals normals() const {
    Normals total;
    for (std::size_t block = 0; block < blocks.size(); ++block)
      total += normals_of(matches[block], isa);
    return total;
  }

  /// Sums what the points of each object cost in a mixture with the shares of this registration. The robust weights
  /// lower the errors; all are scaled up by their mean.
  void sum_objects(Registration& result) const {
    const auto all = static_cast<double>(result.points), mapped = static_cast<double>(result.inliers);
    const auto cost = [&](double part) { return part > 0.0 ? -2.0 * std::log(part / all) : 0.0; };
    const double of_mapped = cost(mapped), of_unmapped = kUnmapped + cost(all - mapped);
    std::array<double, kObjects> errors{}, costs{};
    double total = 0.0;
    for (std::size_t block = 0; block < blocks.size(); ++block)
      for (std::size_t i = 0; i < blocks[block].count; ++i) {
        const std::size_t object = object_at(blocks[block].x_m[i], blocks[block].y_m[i]);
        errors[object] += static_cast<double>(fits[block].error[i]);
        total += static_cast<double>(fits[block].error[i]);
        costs[object] += fits[block].mapped[i] > 0.0F ? of_mapped : of_unmapped;
      }
    const double scale = total > 0.0 ? mapped * result.mean_error / total : 0.0;
    for (std::size_t object = 0; object < kObjects; ++object)
      result.object_costs[object] = static_cast<float>(costs[object] + scale * errors[object]);
  }

  /// Returns the number of points in space that is occupied by a surface of unknown shape.
  [[nodiscard]] std::size_t unknown() const {
    std::ptrdiff_t total = 0;
    for (std::size_t block = 0; block < blocks.size(); ++block)
      total += std::ranges::count(matches[block].unknown, 1.0F);
    return static_cast<std::size_t>(total);
  }

  [[nodiscard]] Matrix6 observability(const Eigen::Matrix3d& R_target_source) const {
    Matrix6 gradients = Matrix6::Zero();
    for (std::size_t block = 0; block < blocks.size(); ++block)
      gradients += gradients_of(R_target_source, blocks[block], matches[block], isa);
    return gradients / std::max(normals().points, 1.0);
  }

  /// Private arena: other users of TBB in the process neither compete with it nor inherit its number of threads.
  tbb::task_arena arena;
  bool parallel;
  Isa isa;
  std::vector<SourceBlock> blocks;
  std::vector<MatchBlock> matches;
  std::vector<FitBlock> fits;
  std::vector<NormalEquations> partial;
  Axes axes{};
  Vector6 twist_of_scan = Vector6::Zero();
};

Gicp::Gicp(int threads, Isa isa) : workers_(std::make_unique<Workers>(threads, isa)) {}
Gicp::~Gicp() = default;

namespace {

/// Eq. 11 in docs/estimator.md. Returns the Gauss-Newton step from `at`.
Vector12 solve(const ElasticEquations& points, const Registration& at, const MotionBelief& prior) {
  Vector12 from_prior;
  from_prior << difference(at.T_target_source, prior.T_target_source), at.twist_base - prior.twist_base;
  Matrix12 H = points.H + prior.information;
  H.diagonal().array() += kDamping;
  return -H.partialPivLu().solve(points.b + prior.information * from_prior);
}

void describe(const ElasticEquations& points, Registration& result) {
  result.inliers = points.of_pose.inliers;
  result.planes = points.of_pose.planes;
  result.mean_error = points.of_pose.error / points.of_pose.weight;
  result.information = points.information;
}

bool is_small(const Vector12& step) {
  return step.head<3>().norm() < kConvergedTranslation_m && step.segment<3>(3).norm() < kConvergedRotation_rad;
}

void move(const Vector12& step, Registration& result) {
  const Pose& T = result.T_target_source;
  result.T_target_source = {(so3_exp(step.segment<3>(3)) * T.rotation).normalized(), T.translation + step.head<3>()};
  result.twist_base += step.tail<6>();
  ++result.iterations;
}

} // namespace

double fit_of(const Registration& registration) {
  constexpr double kMissing = 9.0, kExpected = 1.0;
  return static_cast<double>(registration.inliers) * (kMissing - registration.mean_error) +
         static_cast<double>(registration.unknown) * (kMissing - kExpected);
}

bool is_spread_evenly(const Registration& registration) { return registration.mean_error > kAnywhere; }

namespace {

ObjectEvidence weigh_objects(const Registration& one, const Registration& other, double mean_error) {
  ObjectEvidence evidence;
  for (std::size_t i = 0; i < kObjects; ++i)
    evidence[i] =
        static_cast<float>(honest_share(mean_error) * static_cast<double>(other.object_costs[i] - one.object_costs[i]));
  return evidence;
}

} // namespace

/// Eq. 13 in docs/estimator.md.
ObjectEvidence compare(const Registration& one, const Registration& other) {
  const ObjectEvidence gained = weigh_objects(one, other, one.mean_error);
  return total(gained) > 0.0 ? gained : weigh_objects(one, other, other.mean_error);
}

/// E of eq. 13 in docs/estimator.md.
double total(const ObjectEvidence& evidence) {
  double sum = 0.0;
  for (const float of_object : evidence)
    sum += std::clamp(static_cast<double>(of_object), -kObjectIsStatic, kObjectIsStatic);
  return sum;
}

double evidence(const Registration& one, const Registration& other) { return total(compare(one, other)); }

Registration Gicp::align(const ElasticScan& source, const SurfaceMap& target, const Pose& T_start,
                         const MotionBelief& prior, const RegistrationOptions& options, bool wide,
                         const StopRequested& stop) {
  Registration result;
  result.points = source.points.size();
  result.T_target_source = T_start;
  result.twist_base = source.twist_base;
  workers_->set_source(source);
  if (!T_start.finite() || !target.reaches(T_start.translation)) {
    workers_->sum_objects(result);
    return result;
  }
  double width = wide ? kWidthStartWide : kWidthStart;
  const bool decides = !source.shapeless;
  bool shapeless = source.shapeless.value_or(false);
  bool can_follow = false;
  while (result.iterations < options.max_iterations && (result.iterations == 0 || !stop())) {
    const bool looks_up = result.iterations % kStepsPerLookUp == 0;
    if (looks_up && result.iterations > 0)
      width = std::max(kNarrowing * width, kWidthEnd);
    const LookUp look_up = wide && width > kWidthStart ? LookUp::around : can_follow ? LookUp::follow : LookUp::here;
    const ElasticEquations points =
        workers_->run({target, result.T_target_source, T_start.translation, looks_up ? look_up : LookUp::reuse,
                       shapeless, options.max_correspondence_m, width * width},
                      result.twist_base);
    const bool is_empty = !(points.of_pose.weight > 0.0);
    if (is_empty && (shapeless || !decides || source.points.empty()))
      break;
    if (looks_up)
      can_follow = look_up != LookUp::around;
    if (decides && !shapeless &&
        static_cast<double>(points.of_pose.planes) < kFewPlanes * static_cast<double>(source.points.size())) {
      shapeless = true;
      can_follow = false;
    }
    if (is_empty)
      continue; // no plane at all: once more with shapeless voxels
    const Vector12 step = solve(points, result, prior);
    if (!step.allFinite())
      break;
    describe(points, result);
    move(step, result);
    result.converged = looks_up && width <= kWidthEnd && is_small(step);
    if (result.converged)
      break;
  }
  workers_->sum_objects(result);
  result.unknown = workers_->unknown();
  result.shapeless = shapeless;
  if (result.iterations > 0)
    result.observability = workers_->observability(result.T_target_source.R());
  return result;
}

} // namespace locus
