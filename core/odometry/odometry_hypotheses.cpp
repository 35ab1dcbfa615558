// SPDX-License-Identifier: Apache-2.0
// Choice of the likeliest hypothesis on the motion during a sweep and on the sources that measure it.
#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <utility>

#include "core/odometry/odometry.hpp"

namespace locus {

namespace {

/// Largest deviation from the motion sources for a registration that misses most of the usual correspondences.
constexpr double kLoneDeviation_sigma = 3.0;

/// Prior odds, as twice their logarithm, that a robot that stands does not move off in a sweep.
constexpr double kStaysAtRest = 9.2;

/// Least fit at rest of lidar alone, relative to any other motion. A lower one would hold back a robot that pulls away.
constexpr double kAsGoodAtRest = 0.998;

/// Conditions to start a standstill: the twist is slow for kSlowFor and known to kSlowDoubt times the limit for slow.
constexpr double kSlowDoubt = 4.0;
constexpr Duration kSlowFor = std::chrono::milliseconds{500};

/// Acceleration that an odometry reports, above which it is worth trying whether the wheels slip. A lower one finds
/// more slips and costs more registrations (docs/decisions/053).
constexpr double kSlipsFrom_mps2 = 2.0;

/// Largest change of the yaw rate in a sweep that is considered, in steps: people with a lidar in their hands turn on
/// their heel at 5 rad/s.
constexpr int kMostTurnSteps = 8;

/// Time between the firings of a sweep's points below which they are of one instant.
constexpr float kInstant_s = 0.001F;

/// Standard deviation of the shift that moving objects cause in the position of a robot that stands (chosen, not
/// measured: docs/decisions/054).
constexpr double kShiftByObjects_m = 0.05;

/// Tells whether a twist of zero is within three standard deviations of the prediction.
bool may_rest(const MotionFilter& prediction) {
  constexpr double kSigmas = 3.0, kLeast = 1e-3; // m/s, rad/s
  const Vector6 sigma = prediction.covariance().diagonal().tail<6>().cwiseSqrt();
  return (prediction.twist_base().array().abs() < kSigmas * sigma.array() + kLeast).all();
}

} // namespace

/// Returns the filter after the update with lidar.
MotionFilter Odometry::Hypothesis::updated() const {
  MotionFilter after = filter;
  after.update(fit.T_target_source, fit.twist_base, fit.information);
  return after;
}

Odometry::Hypothesis Odometry::attempt(const Sweep& sweep, const Assumption& assumption, const MotionFilter& last,
                                       const Gicp::StopRequested& stop) {
  Hypothesis hypothesis = assume(sweep, assumption, last);
  register_with(sweep, hypothesis, stop);
  return hypothesis;
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

/// Tells whether the wheels may have begun to slip: the forward speed that they report differs from that of the robot
/// in the last sweep by more than robots usually accelerate, and lidar observes the axis.
bool Odometry::may_slip(const Sweep& sweep, const SourceChoice& choice) const {
  if (!choice.translation || sources_[index_of(*choice.translation)].kind != SourceKind::odometry ||
      !observed_axes_.forward())
    return false;
  const double change_mps = steps_.twist_base(sweep, *choice.translation)->mean[0] - filter_.twist_base()[0];
  return std::abs(change_mps) > kSlipsFrom_mps2 * steps_.elapsed_s(sweep);
}

/// Compares the hypotheses that a slip begins, that one source is wrong, or all are, with the one that none is. Tries
/// them only if a source contradicts the others or the fit is unusually bad, the slip also if wheels may slip, and none
/// without the source of a forward motion that lidar does not observe: there points only seem to decide, most of all
/// those of people who walk along. Returns the registration without sources if it fits better but the faults it assumes
/// are too unlikely.
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
  const bool observes_forward = observed_axes_.forward();
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
  const double fits_better = free.lead() + prior_odds(sweep, best, best.updated()) -
                             prior_odds(sweep, free.hypothesis, free.hypothesis.updated());
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
      if (fit_of(turn.fit) > fit_of(best.fit) && evidence(turn.fit, best.fit) > kKeepsTurning)
        best = std::move(turn);
    }
}

/// Searches for a turn without any source of the rotation, if the points fit by chance under every hypothesis. With the
/// pose and the rate that a jump of a gyro leaves in the filter they are out of reach of their surfaces, whatever is
/// assumed.
void Odometry::consider_jump(const Sweep& sweep, Contest& contest, const Gicp::StopRequested& stop) {
  if (!registered_ || !contest.best.choice.rotation || !fits_by_chance(contest) || stop())
    return;
  Assumption assumption{.without = contest.best.without};
  for (auto source = contest.best.choice.rotation; source; source = choose_among(sweep, assumption.without).rotation)
    assumption.without.set(index_of(*source));
  Hypothesis jump = attempt(sweep, assumption, filter_, stop);
  consider_turns(sweep, jump, stop);
  if (!lidar_health_.is_by_chance(jump.fit))
    contest.enter(against(contest.best, sweep, std::move(jump)));
}

/// Tells whether the points fit by chance under each hypothesis.
bool Odometry::fits_by_chance(const Contest& contest) const {
  return lidar_health_.is_by_chance(contest.best.fit) &&
         std::ranges::all_of(contest.rivals, [this](const std::optional<Rival>& rival) {
           return !rival || lidar_health_.is_by_chance(rival->hypothesis.fit);
         });
}

/// Tells whether lidar is wrong, because its points fit by chance whatever is assumed of the motion. Those of one
/// instant may be right: they cannot be de-skewed.
bool Odometry::is_lidar_wrong(const Sweep& sweep, const Contest& contest) const {
  if (!fits_by_chance(contest))
    return false;
  const auto [newest, oldest] = std::ranges::minmax(sweep.points, {}, &SweepPoint::age_s);
  return oldest.age_s - newest.age_s > kInstant_s;
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
  const MotionFilter after = moving.updated();
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

/// Returns what a robot without lidar knows: a hypothesis with all odometries that repeat their pose, and without the
/// source of the rotation if the others outvote it.
Odometry::Hypothesis Odometry::dead_reckoned(const Sweep& sweep, const Hypothesis& hypothesis) const {
  const auto reckon = [&](std::bitset<kMaxSources> without) {
    Hypothesis reckoned = assume(sweep, {.without = without}, filter_);
    reckoned.scan_to_scan = hypothesis.scan_to_scan;
    reckoned.fit = hypothesis.fit;
    return reckoned;
  };
  const std::bitset<kMaxSources> repeating = repeating_sources(sweep);
  Hypothesis all = (hypothesis.without & repeating).none() ? hypothesis : reckon(hypothesis.without & ~repeating);
  if (!all.choice.rotation || contradictions(sweep, all, all.filter) <= kSourceIsRight) // no majority
    return all;
  std::bitset<kMaxSources> without = all.without;
  Hypothesis outvoting = reckon(without.set(index_of(*all.choice.rotation)));
  return prior_odds(sweep, outvoting, outvoting.filter) > prior_odds(sweep, all, all.filter) ? outvoting : all;
}

/// Returns the likeliest hypothesis for a sweep. The next ones stay as rivals, until later sweeps exclude them.
Odometry::Hypothesis Odometry::choose(const Sweep& sweep, const Gicp::StopRequested& stop) {
  const std::bitset<kMaxSources> repeating = repeating_sources(sweep);
  Contest contest{attempt(sweep, {.without = repeating}, filter_, stop), {}};
  continue_rivals(sweep, contest, stop);
  Hypothesis& best = contest.best;
  gravity_.observe(filter_.pose().rotation.conjugate() * best.filter.pose().rotation, sweep);
  flat_ground_.observe(sweep.end, gravity_.up_base());
  if (sweep.points.size() < kMinPoints)
    return dead_reckoned(sweep, best);
  Hypothesis first = dead_reckoned(sweep, best);
  const std::optional<Registration> lidar_alone = consider_faults(sweep, contest, stop);
  consider_turns(sweep, best, stop);
  consider_jump(sweep, contest, stop);
  if (auto rest = consider_rest(sweep, best, stop))
    best = *std::move(rest);
  if (!stop() && is_lidar_wrong(sweep, contest)) { // one cut short fits badly for that reason alone
    lidar_health_.forgive(best.fit, steps_.elapsed_s(sweep));
    return first;
  }
  if (!best.rests && !is_accepted(sweep, lidar_alone.value_or(best.fit), first))
    return first; // not accepted: dead reckoning assumes no new fault
  best.accepted = true;
  rivals_ = std::move(contest.rivals);
  for (std::optional<Rival>& rival : rivals_)
    if (rival) {
      Hypothesis& other = rival->hypothesis;
      other.filter = other.updated();
      other.filter.learn();
    }
  return std::move(best);
}

/// Returns the source that contradicts all others most, if any: one whose innovation is less likely than its fault.
std::optional<Odometry::Contradiction> Odometry::worst_source(const Sweep& sweep, const Hypothesis& hypothesis) const {
  const MotionFilter after = hypothesis.updated();
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
