// SPDX-License-Identifier: Apache-2.0
// Comparison of the hypotheses for a sweep, and those that are carried from one sweep to the next.
#include <algorithm>
#include <cmath>
#include <functional>
#include <utility>

#include "core/odometry/odometry.hpp"

namespace locus {

namespace {

/// Odds against a rival, as twice their logarithm, from which it is dropped. A lower limit would drop true ones: a
/// sweep that is de-skewed without a gyro fits a little worse everywhere (docs/decisions/063).
constexpr double kExcluded = 100.0;

/// Time for which sweeps count: errors of the map are the same for a while, so that they are no independent evidence.
constexpr double kRemembers_s = 1.0;

/// Distance between a rival and the best hypothesis below which they are the same.
constexpr double kAgrees_m = 0.01;

} // namespace

/// Changes the odds from those against the best hypothesis to those against `other`.
void Odometry::Rival::relate_to(const Rival& other) {
  odds -= other.odds;
  std::ranges::transform(objects, other.objects, objects.begin(), std::minus{});
}

/// Enters a hypothesis, given how likely it is against the best one. The least likely rival is dropped for it.
void Odometry::Contest::enter(Rival other) {
  if (other.lead() > 0.0) {
    for (std::optional<Rival>& rival : rivals)
      if (rival)
        rival->relate_to(other);
    Rival former{std::exchange(best, std::move(other.hypothesis))};
    former.relate_to(other);
    other = std::move(former); // kept, however unlikely now: a takeover may be wrong
  } else if (other.lead() < -kExcluded) {
    return;
  }
  for (std::optional<Rival>& rival : rivals) {
    if (!rival) {
      rival = std::move(other);
      return;
    }
    if (other.lead() > rival->lead())
      std::swap(*rival, other);
  }
}

/// Returns the prior odds, as twice their logarithm, that all sources in use are right when those in `without` are
/// excluded. Gyro and accelerometer of an IMU are one source: they fail together.
double Odometry::odds_of_sources(const Sweep& sweep, std::bitset<kMaxSources> without) const {
  std::bitset<kMaxSources> in_use;
  const SourceChoice choice = choose_among(sweep, without);
  for (const std::optional<SourceId>& source : {choice.rotation, choice.translation})
    if (source)
      in_use.set(index_of(*source));
  if (const std::optional<SpecificForce> force = force_of(sweep, without))
    in_use.set(index_of(force->source));
  return kSourceIsRight * static_cast<double>(in_use.count());
}

/// Returns the odds, as twice their logarithm, against the sources that a hypothesis neither excludes nor needs for the
/// rotation: each measures it, too, and is right or, against its odds, wrong. Compares yaw rates only: gravity shows
/// the others, of which odometries on legs have errors in common. `after`: filter of the hypothesis.
double Odometry::contradictions(const Sweep& sweep, const Hypothesis& hypothesis, const MotionFilter& after) const {
  double odds = 0.0;
  for (std::size_t i = 0; i < sources_.size(); ++i) {
    const SourceId source{i};
    if (hypothesis.without[i] || hypothesis.choice.rotation == source || !steps_.is_usable(sweep, source))
      continue;
    odds += std::min(kSourceIsRight, after.contradiction(source, *steps_.twist_base(sweep, source)));
  }
  return odds;
}

/// O of eq. 13 in docs/estimator.md. Returns the prior odds of a hypothesis, less the contradictions of the sources
/// that it does not use. A fault that continues is no less likely than none. `after`: filter of the hypothesis.
double Odometry::prior_odds(const Sweep& sweep, const Hypothesis& hypothesis, const MotionFilter& after) const {
  return odds_of_sources(sweep, hypothesis.continues ? repeating_sources(sweep) : hypothesis.without) -
         contradictions(sweep, hypothesis, after) - (hypothesis.slips ? hypothesis.filter.odds_against_slip() : 0.0) -
         (hypothesis.turn_radps != 0.0 ? kKeepsTurning : 0.0);
}

/// Eq. 13 in docs/estimator.md. Compares a hypothesis with the best one: by the likelihood of the points, of the
/// motion, and the prior odds.
Odometry::Rival Odometry::against(const Hypothesis& best, const Sweep& sweep, Hypothesis other) const {
  const double odds = best.filter.surprise(best.fit) - other.filter.surprise(other.fit) +
                      prior_odds(sweep, other, other.updated()) - prior_odds(sweep, best, best.updated());
  const ObjectEvidence objects = compare(other.fit, best.fit);
  return {std::move(other), odds, objects};
}

/// Continues the rivals of the last sweep. They differ in the forward motion most; where lidar does not observe it, or
/// is blind, none is continued.
void Odometry::continue_rivals(const Sweep& sweep, Contest& contest, const Gicp::StopRequested& stop) {
  if (observed_axes_.forward() && sweep.points.size() >= kMinPoints)
    for (std::optional<Rival>& before : rivals_)
      if (before && !stop())
        continue_rival(sweep, *before, contest, stop);
  rivals_ = {};
}

/// Continues the rival `before` with what this sweep adds, unless it has come to agree with the best hypothesis.
void Odometry::continue_rival(const Sweep& sweep, Rival& before, Contest& contest, const Gicp::StopRequested& stop) {
  const Assumption assumption{.without = before.hypothesis.without | repeating_sources(sweep), .continues = true};
  Rival rival = against(contest.best, sweep, attempt(sweep, assumption, before.hypothesis.filter, stop));
  const Hypothesis& other = rival.hypothesis;
  if (stop() || lidar_health_.lacks_correspondences(other.fit)) // cut short, or blind
    return;
  const Vector6 apart = difference(other.fit.T_target_source, contest.best.fit.T_target_source);
  const Matrix6 P = contest.best.filter.covariance().topLeftCorner<6, 6>();
  if ((apart.head<3>().norm() < kAgrees_m && apart.dot(P.ldlt().solve(apart)) < 1.0) ||
      other.fit.overlap() < kMinInlierShare)
    return;
  const double remembered = std::exp(-std::max(0.0, steps_.elapsed_s(sweep)) / kRemembers_s); // a clock may step back
  rival.odds += remembered * before.odds;
  for (std::size_t i = 0; i < kObjects; ++i)
    rival.objects[i] += static_cast<float>(remembered) * before.objects[i];
  if (rival.lead() > 0.0) {
    for (std::optional<Rival>& another : rivals_)
      if (another && &*another != &before)
        another->relate_to(before);
    std::swap(filter_, before.hypothesis.filter);
    if (observer_)
      observer_->set_pose(filter_.pose());
  }
  contest.enter(std::move(rival));
}

} // namespace locus
