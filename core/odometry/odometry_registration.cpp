// SPDX-License-Identifier: Apache-2.0
// Registration of a hypothesis: de-skew for its motion, scan-to-scan and scan-to-submap.
#include "core/odometry/odometry.hpp"

namespace locus {

namespace {

/// Standard deviation of the prior position above which correspondences are searched in all voxels around a point.
constexpr double kWide_m = 0.3;

/// Elapsed time, in sweep lengths, above which sweeps were dropped in between.
constexpr double kDropped = 1.5;

} // namespace

/// Returns the twist during the sweep minus the mean since the last processed one, as far as sources measure it. Zero
/// unless sweeps were dropped in between.
Vector6 Odometry::twist_offset_after_drops(const Sweep& sweep) const {
  Vector6 difference = Vector6::Zero();
  if (steps_.elapsed_s(sweep) < kDropped * to_seconds(sweep.end - sweep.start))
    return difference;
  const Vector6 during_sweep = corrected_twist(sweep);
  const auto [rotation, translation] = choose_among(sweep, {});
  if (translation)
    difference.head<3>() = (during_sweep - steps_.twist_base(sweep, *translation)->mean).head<3>();
  if (rotation)
    difference.tail<3>() = (during_sweep - steps_.twist_base(sweep, *rotation)->mean).tail<3>();
  return difference;
}

/// De-skews the points for a base that moved with mean twist `twist_base` since the last sweep. If sources are
/// excluded, their motion within the sweep is removed, unless they repeat their pose: then there is none.
void Odometry::correct(const Sweep& sweep, const Vector6& twist_base, std::bitset<kMaxSources> without) {
  without &= ~repeating_sources(sweep);
  move_points(sweep, without.any() ? SweepCorrection::constant(sweep, twist_base)
                                   : SweepCorrection::all(sweep, twist_base + twist_offset_after_drops(sweep)));
}

void Odometry::move_points(const Sweep& sweep, const SweepCorrection& correction) {
  correction_ = correction;
  correction_.apply(sweep.points, scan_);
}

/// Registers the sweep with the last one, starting from the hypothesis. The result is only the starting pose for the
/// submap, not a measurement, because the submap contains the last sweep, too.
void Odometry::match_last(const Sweep& sweep, const MotionBelief& belief, Hypothesis& hypothesis,
                          const Gicp::StopRequested& stop) {
  const StageScope scope(clock_, Stage::scan_to_scan);
  const Registration found = gicp_.align(aged_.sort(sweep, scan_, belief.twist_base), last_scan_map_,
                                         belief.T_target_source, belief, options_.scan_to_scan, false, stop);
  if (found.converged)
    hypothesis.fit.T_target_source = found.T_target_source;
  hypothesis.scan_to_scan = found;
  hypothesis.scan_to_scan.T_target_source = filter_.pose().inverse() * found.T_target_source;
}

/// Returns the points of the sweep by age. The first registration of a sweep decides for all whether voxels without a
/// plane serve: hypotheses compare only if they fit the points to the same surfaces.
ElasticScan Odometry::aged_scan(const Sweep& sweep, const Vector6& twist_base) {
  ElasticScan scan = aged_.sort(sweep, scan_, twist_base);
  scan.shapeless = shapeless_;
  return scan;
}

/// Registers the sweep with the submap, starting from the hypothesis. A registration that does not converge goes on
/// once more from where it stopped, with the points de-skewed for the motion found so far.
void Odometry::register_with(const Sweep& sweep, Hypothesis& hypothesis, const Gicp::StopRequested& stop) {
  MotionBelief belief = hypothesis.filter.belief();
  RegistrationOptions options = options_.scan_to_submap;
  if (hypothesis.rests) {
    belief.T_target_source = filter_.pose();
    belief.twist_base.setZero();
    belief.information = 1e12 * Matrix12::Identity();
    options.max_iterations = 4;
  }
  hypothesis.fit = {};
  hypothesis.fit.T_target_source = belief.T_target_source;
  hypothesis.fit.twist_base = belief.twist_base;
  const std::bitset<kMaxSources> without = hypothesis.rests ? kAllSources : hypothesis.without;
  correct(sweep, belief.twist_base, without);
  if (sweep.points.size() < kMinPoints)
    return;
  if (has_last_scan_ && !hypothesis.rests)
    match_last(sweep, belief, hypothesis, stop);
  const StageScope scope(clock_, Stage::scan_to_submap);
  const bool wide =
      hypothesis.turn_radps != 0.0 ||
      (!hypothesis.rests && hypothesis.filter.covariance().diagonal().head<3>().maxCoeff() > kWide_m * kWide_m);
  const Pose T_start = hypothesis.fit.T_target_source;
  hypothesis.fit = gicp_.align(aged_scan(sweep, belief.twist_base), map_, T_start, belief, options, wide, stop);
  if (!shapeless_)
    shapeless_ = hypothesis.fit.shapeless;
  if (hypothesis.fit.converged || stop())
    return;
  const int before = hypothesis.fit.iterations;
  correct(sweep, hypothesis.fit.twist_base, without);
  hypothesis.fit = gicp_.align(aged_scan(sweep, hypothesis.fit.twist_base), map_, hypothesis.fit.T_target_source,
                               belief, options, false, stop);
  hypothesis.fit.iterations += before;
}

} // namespace locus
