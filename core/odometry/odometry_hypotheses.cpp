// SPDX-License-Identifier: Apache-2.0
// Choice of the likeliest hypothesis on the motion during a sweep and on the sources that measure it.
#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <functional>
#include <utility>

#include "core/odometry/odometry.hpp"

namespace locus {

namespace {

/// Least overlap of an accepted registration.
constexpr double kMinInlierShare = 0.1;

/// Largest deviation from the motion sources for a registration that misses most of the usual correspondences.
constexpr double kLoneDeviation_sigma = 3.0;

/// Prior odds, as twice their logarithm, that a robot that stands does not move off in a sweep.
constexpr double kStaysAtRest = 9.2;

/// Least fit at rest of lidar alone, relative to any other motion. A lower one would hold back a robot that pulls away.
constexpr double kAsGoodAtRest = 0.998;

/// Conditions to start a standstill: the twist is slow for kSlowFor and known to kSlowDoubt times the limit for slow.
constexpr double kSlowDoubt = 4.0;
constexpr Duration kSlowFor = std::chrono::milliseconds{500};

/// Odds against a rival, as twice their logarithm, from which it is dropped. A lower limit would drop true ones: a
/// sweep that is de-skewed without a gyro fits a little worse everywhere (docs/decisions/063).
constexpr double kExcluded = 100.0;

/// Time for which sweeps count: errors of the map are the same for a while, so that they are no independent evidence.
constexpr double kRemembers_s = 1.0;

/// Distance between a rival and the best hypothesis below which they are the same.
constexpr double kAgrees_m = 0.01;

/// Acceleration that an odometry reports, above which it is worth trying whether the wheels slip. A lower one finds
/// more slips and costs more registrations (docs/decisions/053).
constexpr double kSlipsFrom_mps2 = 2.0;

/// Prior odds, as twice their logarithm, that no turn begins or ends in a sweep; largest change of the yaw rate in a
/// sweep that is considered, in steps: people with a lidar in their hands turn on their heel at 5 rad/s.
constexpr double kKeepsTurning = 9.2;
constexpr int kMostTurnSteps = 8;

/// Standard deviation of the shift that moving objects cause in the position of a robot that stands (chosen, not
/// measured: docs/decisions/054).
constexpr double kShiftByObjects_m = 0.05;

/// Tells whether a twist of zero is within three standard deviations of the prediction.
bool may_rest(const MotionFilter& prediction) {
  constexpr double kSigmas = 3.0, kLeast = 1e-3; // m/s, rad/s
  const Vector6 sigma = prediction.covariance().diagonal().tail<6>().cwiseSqrt();
  return (prediction.twist_base().array().abs() < kSigmas * sigma.array() + kLeast).all();
}

/// Tells whether lidar observes the forward motion. Hypotheses on the sources differ in it most; where lidar does not
/// observe it, points only seem to decide, most of all those of people who walk along.
bool is_forward_observed(const ObservedAxes& axes) { return axes.each()[0]; }

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

Odometry::Hypothesis Odometry::attempt(const Sweep& sweep, const Assumption& assumption, const MotionFilter& last,
                                       const Gicp::StopRequested& stop) {
  Hypothesis hypothesis = assume(sweep, assumption, last);
  register_with(sweep, hypothesis, stop);
  return hypothesis;
}

/// Returns the prior odds, as twice their logarithm, that all sources in use are right when those in `without` are
/// excluded. The accelerometer counts as a source.
double Odometry::odds_of_sources(const Sweep& sweep, std::bitset<kMaxSources> without) const {
  const SourceChoice choice = choose_among(sweep, without);
  const int sources = int{choice.rotation.has_value()} +
                      int{choice.translation.has_value() && choice.translation != choice.rotation} +
                      int{force_of(sweep, without).has_value()};
  return kSourceIsRight * sources;
}

/// O of eq. 13 in docs/estimator.md. Returns the prior odds of a hypothesis. A fault that continues is no less likely
/// than none.
double Odometry::prior_odds(const Sweep& sweep, const Hypothesis& hypothesis) const {
  return odds_of_sources(sweep, hypothesis.continues ? repeating_sources(sweep) : hypothesis.without) -
         (hypothesis.slips ? hypothesis.filter.odds_against_slip() : 0.0);
}

/// Returns the odometries that repeat their pose: they measure a standstill, or are stuck.
std::bitset<kMaxSources> Odometry::repeating_sources(const Sweep& sweep) const {
  std::bitset<kMaxSources> repeating;
  for (std::size_t i = 0; i < sources_.size(); ++i)
    repeating[i] = sources_[i].kind == SourceKind::odometry && steps_.is_usable(sweep, SourceId{i}) &&
                   steps_.repeats(sweep, SourceId{i});
  return repeating;
}

/// Returns the odds, as twice their logarithm, that an odometry which repeats its pose is not stuck; nothing if none
/// repeats it. They are the lower, the farther the robot has moved since the last change. The highest for several.
std::optional<double> Odometry::odds_against_stuck(std::bitset<kMaxSources> repeating) const {
  if (repeating.none())
    return std::nullopt;
  double odds = 0.0;
  for (std::size_t i = 0; i < sources_.size(); ++i) {
    if (!repeating[i])
      continue;
    double moved2 = 0.0; // squared Mahalanobis distance
    if (const std::optional<LastChange>& last = last_changes_[i]) {
      const Eigen::Vector3d moved_m = filter_.pose().translation - last->position_m;
      const Eigen::Matrix3d covariance = last->covariance + filter_.covariance().topLeftCorner<3, 3>() +
                                         kShiftByObjects_m * kShiftByObjects_m * Eigen::Matrix3d::Identity();
      moved2 = moved_m.dot(covariance.ldlt().solve(moved_m));
    }
    odds = std::max(odds, kSourceIsRight - moved2);
  }
  return odds;
}

/// Eq. 13 in docs/estimator.md. Compares a hypothesis with the best one: by the likelihood of the points, of the
/// motion, and the prior odds.
Odometry::Rival Odometry::against(const Hypothesis& best, const Sweep& sweep, Hypothesis other) const {
  const double odds = best.filter.surprise(best.fit) - other.filter.surprise(other.fit) + prior_odds(sweep, other) -
                      prior_odds(sweep, best);
  const ObjectEvidence objects = compare(other.fit, best.fit);
  return {std::move(other), odds, objects};
}

/// Continues the rivals of the last sweep.
void Odometry::continue_rivals(const Sweep& sweep, Contest& contest, const Gicp::StopRequested& stop) {
  if (is_forward_observed(observed_axes_))
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

/// Tells whether the wheels may have begun to slip: the forward speed that they report differs from that of the robot
/// in the last sweep by more than robots usually accelerate, and lidar observes the axis.
bool Odometry::may_slip(const Sweep& sweep, const SourceChoice& choice) const {
  if (!choice.translation || sources_[index_of(*choice.translation)].kind != SourceKind::odometry ||
      !is_forward_observed(observed_axes_))
    return false;
  const double change_mps = steps_.twist_base(sweep, *choice.translation)->mean[0] - filter_.twist_base()[0];
  return std::abs(change_mps) > kSlipsFrom_mps2 * steps_.elapsed_s(sweep);
}

/// Compares the hypotheses that a slip begins, that one source is wrong, or all are, with the one that none is. Tries
/// them only if a source contradicts the others or the fit is unusually bad, the slip also if wheels may slip, and none
/// without the source of a forward motion that lidar does not observe. Returns the registration without sources if it
/// fits better but the faults it assumes are too unlikely.
std::optional<Registration> Odometry::consider_faults(const Sweep& sweep, Contest& contest,
                                                      const Gicp::StopRequested& stop) {
  const Hypothesis& best = contest.best;
  const std::bitset<kMaxSources> repeating = repeating_sources(sweep);
  const auto contradiction = worst_source(sweep, best);
  const auto is_unusual = [&] { return lidar_health_.is_unusual(best.fit); };
  if (stop()) // a registration cut short fits badly for that reason alone
    return std::nullopt;
  const auto try_out = [&](const Assumption& assumption) {
    contest.enter(against(best, sweep, attempt(sweep, assumption, filter_, stop)));
  };
  const auto is_suspect = [&](std::optional<SourceId> source) {
    return contradiction && source && index_of(*source) == contradiction->source;
  };
  const bool observes_forward = is_forward_observed(observed_axes_);
  if (may_slip(sweep, best.choice) || (observes_forward && is_suspect(best.choice.translation)))
    try_out({.without = repeating, .slips = true});
  if (!contradiction && !is_unusual())
    return std::nullopt;
  std::array<std::optional<SourceId>, 2> suspects{best.choice.translation, best.choice.rotation};
  if (suspects[0] == suspects[1])
    suspects[1].reset();
  if (is_suspect(suspects[1]))
    std::swap(suspects[0], suspects[1]);
  for (const std::optional<SourceId>& suspect : suspects) {
    const bool is_explained = (best.slips || (best.without & ~repeating).any()) && !is_unusual();
    if (!suspect || is_explained || stop() || (!observes_forward && suspect == best.choice.translation))
      continue;
    Assumption assumption{.without = repeating};
    assumption.without.set(index_of(*suspect));
    try_out(assumption);
  }
  if (!is_unusual() || stop() || !(suspects[0] || suspects[1]) || (!observes_forward && best.choice.translation))
    return std::nullopt;
  Rival free = against(best, sweep, attempt(sweep, {.without = kAllSources}, filter_, stop));
  const double fits_better = free.lead() + prior_odds(sweep, best) - prior_odds(sweep, free.hypothesis);
  std::optional<Registration> too_unlikely;
  if (free.lead() <= 0.0 && fits_better > 0.0)
    too_unlikely = free.hypothesis.fit;
  contest.enter(std::move(free));
  return too_unlikely;
}

/// Searches from other yaw rates where no source measures the rotation and the fit is unusually bad: a turn that begins
/// within a sweep takes the points out of reach of their surfaces. Selects the likeliest rate. With lidar alone, what a
/// motion costs under the prediction says nothing about a turn, so the points decide against the prior odds.
void Odometry::consider_turns(const Sweep& sweep, Hypothesis& best, const Gicp::StopRequested& stop) {
  if (best.choice.rotation)
    return;
  for (int step = 1; step <= kMostTurnSteps; ++step)
    for (const double turn_radps : {-step * kTurnStep_radps, step * kTurnStep_radps}) {
      if (!lidar_health_.is_unusual(best.fit) || stop())
        return;
      Hypothesis turn = attempt(sweep, {.without = best.without, .turn_radps = turn_radps}, filter_, stop);
      const bool comparable = best.fit.shapeless || !turn.fit.shapeless; // voxels without a plane only add points
      if (comparable && fit_of(turn.fit) > fit_of(best.fit) && evidence(turn.fit, best.fit) > kKeepsTurning)
        best = std::move(turn);
    }
}

/// Tells whether a standstill is likelier than a motion. Where sources measure the motion, the odds are those of the
/// points, of what the sources measure, and Occam's factor of the motion that a standstill spares.
bool Odometry::is_likelier(const Registration& at_rest, const Hypothesis& moving,
                           std::optional<double> odds_against_stuck) const {
  if (!moving.choice.rotation && !moving.choice.translation && !odds_against_stuck)
    return fit_of(at_rest) > kAsGoodAtRest * fit_of(moving.fit);
  return evidence(at_rest, moving.fit) + moving.filter.surprise(moving.fit) - moving.filter.surprise_at_rest() +
             (stands_ ? kStaysAtRest : 0.0) + odds_against_stuck.value_or(0.0) >
         0.0;
}

/// Returns a standstill if the robot may stand and it is likelier than the motion.
std::optional<Odometry::Hypothesis> Odometry::consider_rest(const Sweep& sweep, const Hypothesis& moving,
                                                            const Gicp::StopRequested& stop) {
  MotionFilter after = moving.filter;
  after.update(moving.fit.T_target_source, moving.fit.twist_base, moving.fit.information);
  const Vector6 sigma_after = after.covariance().diagonal().tail<6>().cwiseSqrt();
  const bool slow = (moving.fit.twist_base.array().abs() < kSlow.array()).all() &&
                    (sigma_after.array() < kSlowDoubt * kSlow.array()).all(); // standstill requires an observed twist
  if (!slow)
    slow_since_ = sweep.end;
  const std::bitset<kMaxSources> repeating = repeating_sources(sweep);
  const std::optional<double> odds = odds_against_stuck(repeating);
  if ((stop() && !stands_) || !may_rest(moving.filter) ||
      (!stands_ && odds.value_or(0.0) <= 0.0 && sweep.end - slow_since_ < kSlowFor))
    return std::nullopt;
  Hypothesis rest = attempt(sweep, {.without = moving.without & ~repeating, .rests = true}, filter_, stop);
  if (!is_likelier(rest.fit, moving, odds))
    return std::nullopt;
  rest.filter.set_pose(filter_.pose());
  return rest;
}

/// Returns a hypothesis with all odometries that repeat their pose: what a robot without lidar knows.
Odometry::Hypothesis Odometry::dead_reckoned(const Sweep& sweep, const Hypothesis& hypothesis) const {
  const std::bitset<kMaxSources> repeating = repeating_sources(sweep);
  if ((hypothesis.without & repeating).none())
    return hypothesis;
  Hypothesis all = assume(sweep, {.without = hypothesis.without & ~repeating}, filter_);
  all.scan_to_scan = hypothesis.scan_to_scan;
  all.fit = hypothesis.fit;
  return all;
}

/// Returns the likeliest hypothesis for a sweep. The next ones stay as rivals, until later sweeps exclude them.
Odometry::Hypothesis Odometry::choose(const Sweep& sweep, const Gicp::StopRequested& stop) {
  const std::bitset<kMaxSources> repeating = repeating_sources(sweep);
  Contest contest{attempt(sweep, {.without = repeating}, filter_, stop), {}};
  if (sweep.points.size() >= kMinPoints)
    continue_rivals(sweep, contest, stop);
  Hypothesis& best = contest.best;
  gravity_.observe(filter_.pose().rotation.conjugate() * best.filter.pose().rotation, sweep);
  flat_ground_.observe(sweep.end, gravity_.up_base());
  if (sweep.points.size() < kMinPoints)
    return dead_reckoned(sweep, best);
  Hypothesis first = dead_reckoned(sweep, best);
  const std::optional<Registration> lidar_alone = consider_faults(sweep, contest, stop);
  consider_turns(sweep, best, stop);
  if (auto rest = consider_rest(sweep, best, stop))
    best = *std::move(rest);
  if (!best.rests && !is_accepted(sweep, lidar_alone.value_or(best.fit), first))
    return first; // not accepted: dead reckoning assumes no new fault
  best.accepted = true;
  rivals_ = std::move(contest.rivals);
  for (std::optional<Rival>& rival : rivals_)
    if (rival) {
      Hypothesis& other = rival->hypothesis;
      other.filter.update(other.fit.T_target_source, other.fit.twist_base, other.fit.information);
      other.filter.learn();
    }
  return std::move(best);
}

/// Returns the source that contradicts all others most, if any: one whose innovation is less likely than its fault.
std::optional<Odometry::Contradiction> Odometry::worst_source(const Sweep& sweep, const Hypothesis& hypothesis) const {
  MotionFilter after = hypothesis.filter;
  after.update(hypothesis.fit.T_target_source, hypothesis.fit.twist_base, hypothesis.fit.information);
  std::optional<Contradiction> worst;
  for (const auto& source : {hypothesis.choice.rotation, hypothesis.choice.translation}) {
    if (!source)
      continue;
    const Innovation found = after.innovation(*source, *steps_.twist_base(sweep, *source), true);
    const bool is_odometry = sources_[index_of(*source)].kind == SourceKind::odometry;
    const double fault = is_odometry ? after.odds_against_slip() : kSourceIsRight;
    for (int axis = 0; axis < 6; ++axis) {
      if (found.variance[axis] <= 0.0)
        continue;
      const double excess = found.value[axis] * found.value[axis] / found.variance[axis] - fault;
      if (excess > (worst ? worst->evidence : 0.0))
        worst = {index_of(*source), excess};
    }
  }
  return worst;
}

/// Returns whether a registration is accepted. One that misses most of the usual correspondences is rejected if it
/// deviates from the prediction of `all_sources`, unless lidar had no registration for a while.
bool Odometry::is_accepted(const Sweep& sweep, const Registration& fit, const Hypothesis& all_sources) const {
  if (fit.iterations == 0 || !fit.T_target_source.finite() || fit.overlap() < kMinInlierShare)
    return false;
  const bool was_registered = registered_ || (map_policy_.is_refused() && map_policy_.was_accepted_lately(sweep.end));
  if (!all_sources.choice.translation || !was_registered || !lidar_health_.lacks_correspondences(fit))
    return true;
  const Vector6 deviation = difference(fit.T_target_source, all_sources.filter.pose()).cwiseAbs();
  const Vector6 sigma = all_sources.filter.covariance().diagonal().head<6>().cwiseSqrt();
  return (deviation.array() <= kLoneDeviation_sigma * sigma.array()).all();
}

} // namespace locus
