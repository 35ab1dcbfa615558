// SPDX-License-Identifier: Apache-2.0
// Calibration states of the sources, and their noise, which is learned from the innovations (variance components).
#include <algorithm>
#include <cmath>
#include <span>

#include "core/odometry/motion_filter.hpp"
#include "core/odometry/motion_filter_states.hpp"

namespace locus {

using namespace motion_filter;

namespace {

/// Random walks of the calibration per square root of a second.
constexpr double kGyroWalk = 1e-4, kLateWalk = 1e-5, kMountingWalk = 1e-5, kScaleWalk = 3e-4;

constexpr double kSlip_mps = 0.003, kSlipLasts_s = 1.0; ///< forward slip of an odometry

/// Least noise of the sources: variance of position (m) and rotation (rad) after one second.
const Vector6 kLeastOdometryNoise = squares(0.006, 0.001), kLeastGyroNoise = squares(1.0, 0.001);

constexpr double kLearns_s = 5.0;      ///< time constant of the learned noise
constexpr double kPriorWeight_s = 0.5; ///< weight of the prior noise, as a duration
constexpr double kMostSigmas = 3.0;    ///< innovations are clipped here before the noise is learned from them

/// Returns the number of calibration states of a source: three biases, the lateness and three mounting angles of a
/// gyro, or two scales and two directions of an odometry.
int states_of(SourceKind kind) { return kind == SourceKind::imu ? 7 : 4; }

/// Returns the random walk of these states per square root of a second.
LearnedSource::States walk_of(SourceKind kind) {
  if (kind == SourceKind::imu)
    return {kGyroWalk, kGyroWalk, kGyroWalk, kLateWalk, kMountingWalk, kMountingWalk, kMountingWalk};
  return {kScaleWalk, kScaleWalk, kScaleWalk, kScaleWalk, 0.0, 0.0, 0.0};
}

} // namespace

/// Appends the states of a source to the state vector.
void MotionFilter::add_source(const MotionSourceOptions& options, Source& source) {
  const LearnedSource known = as_configured(options);
  source.kind = options.kind;
  source.lever_m = options.T_base_source.translation;
  source.state = states_;
  source.states = states_of(source.kind);
  source.first = known.states;
  source.first_variance = known.covariance.diagonal();
  source.first_noise_per_s = known.noise_per_s;
  if (options.calibration != Calibration::automatic) // a gyro's bias is always estimated: it is never configured
    source.first_variance.tail(LearnedSource::kMostStates - (source.kind == SourceKind::imu ? LearnedSource::kLate : 0))
        .setZero();
  source.fades_per_s = (source.first_variance.array() > 0.0)
                           .select(0.5 * walk_of(source.kind).cwiseAbs2().cwiseQuotient(source.first_variance), 0.0);
  states_ += source.states;
  if (source.kind == SourceKind::odometry)
    source.slip = states_++;
}

void MotionFilter::reset_source(SourceId source) {
  Source& of = sources_[index_of(source)];
  P_.reset(of.state, of.first_variance.head(of.states).asDiagonal().toDenseMatrix());
  if (of.slip)
    revert(*of.slip, 0.0, square(kSlip_mps), 0.0);
  // Lateness and mounting of a gyro keep their values.
  const int changed = of.kind == SourceKind::imu ? LearnedSource::kLate : of.states;
  x_.segment(of.state, changed) = of.first.head(changed);
  of.noise_per_s = of.first_noise_per_s;
  of.learned_s.setZero();
  of.last_twist.reset();
}

void MotionFilter::recall(SourceId source, const LearnedSource& learned, double elapsed_s) {
  reset_source(source);
  Source& of = sources_[index_of(source)];
  of.noise_per_s = learned.noise_per_s;
  LearnedSource::Covariance covariance = learned.covariance;
  for (int i = 0; i < of.states; ++i)
    if (of.first_variance[i] == 0.0) { // configured as exact
      covariance.row(i).setZero();
      covariance.col(i).setZero();
    } else {
      x_[of.state + i] = learned.states[i];
    }
  P_.reset(of.state, covariance.topLeftCorner(of.states, of.states));
  age(of, elapsed_s);
}

/// Relaxes the calibration of a source towards its prior, so it is never less certain than the configuration.
void MotionFilter::age(const Source& source, double elapsed_s) {
  for (int i = 0; i < source.states; ++i)
    revert(source.state + i, source.first[i], source.first_variance[i], std::exp(-source.fades_per_s[i] * elapsed_s));
  if (source.slip)
    revert(*source.slip, 0.0, square(kSlip_mps), std::exp(-elapsed_s / kSlipLasts_s));
}

/// Eq. 4 in docs/estimator.md. Propagates a state that reverts to a mean (Ornstein-Uhlenbeck process); `retained` is
/// the factor by which its deviation decays.
void MotionFilter::revert(int state, double mean, double variance, double retained) {
  x_[state] = mean + retained * (x_[state] - mean);
  P_.revert(state, retained, variance);
}

LearnedSource MotionFilter::learned(SourceId source) const {
  const Source& of = sources_[index_of(source)];
  LearnedSource learned{.noise_per_s = of.noise_per_s};
  learned.states.head(of.states) = x_.segment(of.state, of.states);
  learned.covariance.topLeftCorner(of.states, of.states) = P_.matrix().block(of.state, of.state, of.states, of.states);
  return learned;
}

void MotionFilter::learn() {
  for (Source& source : std::span(sources_).first(count_))
    if (source.used)
      learn_noise(source);
}

namespace {

/// Eq. 14 in docs/estimator.md. Moves a variance towards the one that an innovation implies. `others`: variance of the
/// estimate from all other sources.
void learn_variance(double& variance, double& learned_s, double innovation, double known, double others, double per,
                    double elapsed_s, double least) {
  const double expected = variance * per + known;
  const double weight = square(expected / (expected + others)); // share of the innovation due to this source
  const double most = square(kMostSigmas) * (expected + others);
  const double found = (std::min(square(innovation), most) - others - known) / per;
  learned_s = std::min(learned_s + weight * elapsed_s, kLearns_s);
  variance += weight * elapsed_s / (kPriorWeight_s + learned_s) * (found - variance);
  variance = std::max(variance, least);
}

} // namespace

void MotionFilter::learn_noise(Source& source) {
  const Innovation found = innovation(SourceId{static_cast<std::size_t>(&source - sources_.data())}, source.sensed);
  const Vector6& least = source.kind == SourceKind::imu ? kLeastGyroNoise : kLeastOdometryNoise;
  for (int axis = 0; axis < 6; ++axis) {
    const bool force_measured = axis < 3 && last_force_;
    const bool observed = force_measured || found.others[axis] < kObservedRatio * predicted_variance_[axis];
    if (source.variance[axis] == 0.0 || !observed)
      continue; // no reference to compare with
    learn_variance(source.noise_per_s[axis], source.learned_s[axis], found.value[axis], source.known_variance[axis],
                   found.others[axis], 1.0 / elapsed_s_, elapsed_s_, least[axis]);
  }
  source.last_twist = source.sensed.mean;
}

} // namespace locus
