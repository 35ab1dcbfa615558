// SPDX-License-Identifier: Apache-2.0
#include "daemon/odometry_comparison.hpp"

#include <Eigen/LU>

#include <algorithm>
#include <cmath>

namespace locus::daemon {
namespace {

constexpr std::size_t kFewestBlocks = 6;

constexpr double kYawDrift_radps = 0.02, kOffset_m = 0.3; ///< priors of the parameters that are not reported

/// Noise of the difference of a turn rate in a sweep, and of motion in a window. It only weights rows.
constexpr double kTurnRateNoise_radps = 0.01;
constexpr double kWayNoise_m = 0.02, kTurnNoise_rad = 0.005;

/// Motion that exceeds the noise of lidar; slower changes carry no information on lateness, slower motion none on axes.
constexpr double kPlainChange_radps2 = 0.15;
constexpr double kPlainTurn_rad = 0.1, kPlainWay_m = 0.2;

/// Largest difference that is no fault of the odometry, such as a slip.
constexpr double kFault_mps = 0.6, kFault_radps = 0.5;

/// Errors relative to the size of a result: motion between sweeps is not linear; the prior of a registration includes
/// the odometry itself.
constexpr double kNonlinearity = 0.1, kOwnShare = 0.05;
/// Error of the axes of a lidar from the angles of its lasers and from ranges at grazing incidence.
constexpr double kLaserAngle_rad = 0.1 * kRadPerDeg;

constexpr Duration kWindow = std::chrono::seconds{1};
constexpr Duration kLongestStep = std::chrono::milliseconds{300};

} // namespace

template <int kParameters>
BlockedLeastSquares<kParameters>::BlockedLeastSquares(const Row& prior_sigma)
    : prior_information_(prior_sigma.cwiseAbs2().cwiseInverse().asDiagonal()) {
  blocks_.reserve(kMostBlocks);
}

template <int kParameters>
void BlockedLeastSquares<kParameters>::add(Stamp stamp, const Row& row, double value, double sigma) {
  if (!block_start_ || stamp - *block_start_ >= block_length_ || stamp < *block_start_) {
    block_start_ = stamp;
    if (blocks_.size() == kMostBlocks) {
      for (std::size_t i = 0; i < kMostBlocks / 2; ++i) {
        const Block &one = blocks_[2 * i], &other = blocks_[2 * i + 1];
        blocks_[i] = {one.A + other.A, one.b + other.b};
      }
      blocks_.resize(kMostBlocks / 2);
      block_length_ *= 2;
    }
    blocks_.emplace_back();
  }
  blocks_.back().A += row * row.transpose() / (sigma * sigma);
  blocks_.back().b += row * value / (sigma * sigma);
}

/// Scales the weights such that the blocks scatter as they imply, so that the prior counts as much as it should.
template <int kParameters>
typename BlockedLeastSquares<kParameters>::Solution BlockedLeastSquares<kParameters>::solve() const {
  const Matrix prior_covariance = prior_information_.inverse();
  if (blocks_.size() < kFewestBlocks)
    return {Row::Zero(), prior_covariance};
  Block all;
  for (const Block& block : blocks_) {
    all.A += block.A;
    all.b += block.b;
  }
  const auto scatter_about = [&](const Row& mean) {
    const auto count = static_cast<double>(blocks_.size());
    Matrix scatter = Matrix::Zero();
    for (const Block& block : blocks_) {
      const Row gradient = block.b - block.A * mean;
      scatter += count / (count - kParameters) * gradient * gradient.transpose();
    }
    return scatter;
  };
  const Matrix weighted = (all.A + prior_information_).inverse();
  const double determined = std::max(1e-3, (weighted * all.A).trace());
  const double excess = std::max(1.0, (weighted * scatter_about(weighted * all.b)).trace() / determined);
  const Matrix covariance = (all.A / excess + prior_information_).inverse();
  const Row mean = covariance * all.b / excess;
  return {mean, covariance * (scatter_about(mean) / (excess * excess) + prior_information_) * covariance};
}

template class BlockedLeastSquares<2>;
template class BlockedLeastSquares<3>;
template class BlockedLeastSquares<4>;

OdometryComparison::OdometryComparison()
    : lateness_({OdometryFindings::kPriorLate_s, OdometryFindings::kPriorYawScale, kYawDrift_radps}),
      yaw_({OdometryFindings::kPriorYawScale, kYawDrift_radps}),
      turn_({OdometryFindings::kPriorTurn_rad, OdometryFindings::kPriorTurn_rad, OdometryFindings::kPriorTurn_rad,
             kOffset_m}) {}

void OdometryComparison::interrupt() {
  steps_ = 0;
  window_ = {};
  window_length_ = {};
}

void OdometryComparison::add(Stamp end, const Pose& T_source_base, const Vector6& lidar_twist_base) {
  const Step last = recent_.back();
  std::rotate(recent_.begin(), recent_.begin() + 1, recent_.end());
  Step& step = recent_.back();
  step = {.end = end, .T_source_base = T_source_base, .lidar = lidar_twist_base};
  const Duration elapsed = end - last.end;
  if (steps_ > 0 && (elapsed <= Duration::zero() || elapsed > kLongestStep))
    interrupt();
  if (++steps_ == 1)
    return;
  step.sensed = se3_log(last.T_source_base.inverse() * T_source_base) / to_seconds(elapsed);
  const Vector6 excess = step.sensed - step.lidar;
  if (!(excess.head<3>().norm() < kFault_mps && excess.tail<3>().norm() < kFault_radps)) { // not a number, either
    interrupt();
    steps_ = 1;
    return;
  }
  accumulate(step, elapsed);
  if (steps_ > recent_.size()) // the first step has a pose, but no twist
    compare_times(recent_[0], recent_[1], recent_[2]);
}

/// Compares the yaw rate with its change from the last to the next step.
void OdometryComparison::compare_times(const Step& last, const Step& step, const Step& next) {
  constexpr int kYaw = 5;
  const double change_per_s = (next.lidar[kYaw] - last.lidar[kYaw]) / to_seconds(next.end - last.end);
  if (std::abs(change_per_s) > kPlainChange_radps2)
    lateness_.add(step.end, {-change_per_s, step.lidar[kYaw], 1.0}, step.sensed[kYaw] - step.lidar[kYaw],
                  kTurnRateNoise_radps);
}

void OdometryComparison::accumulate(const Step& step, Duration elapsed) {
  window_.end = step.end;
  window_.sensed += to_seconds(elapsed) * step.sensed;
  window_.lidar += to_seconds(elapsed) * step.lidar;
  window_length_ += elapsed;
  if (window_length_ < kWindow)
    return;
  compare_motion();
  window_ = {};
  window_length_ = {};
}

/// Compares the motion in a window. Lidar mounted with an error of `turn` observes a vector v as v - turn x v.
void OdometryComparison::compare_motion() {
  const Vector6 excess = window_.lidar - window_.sensed;
  const double ahead_m = window_.lidar[0], yaw_rad = window_.lidar[5];
  if (std::abs(ahead_m) > kPlainWay_m) {
    turn_.add(window_.end, {0.0, ahead_m, 0.0, 0.0}, excess[2], kWayNoise_m);
    turn_.add(window_.end, {0.0, 0.0, -ahead_m, yaw_rad}, excess[1], kWayNoise_m);
  }
  if (std::abs(yaw_rad) > kPlainTurn_rad) {
    turn_.add(window_.end, {0.0, -yaw_rad, 0.0, 0.0}, excess[3], kTurnNoise_rad);
    turn_.add(window_.end, {yaw_rad, 0.0, 0.0, 0.0}, excess[4], kTurnNoise_rad);
    yaw_.add(window_.end, {yaw_rad, to_seconds(window_length_)}, -excess[5], kTurnNoise_rad);
  }
}

OdometryFindings OdometryComparison::findings() const {
  const auto figure = [](const auto& solution, int i, double relative, double least) {
    const double mean = solution.mean[i];
    return Learned{mean, std::sqrt(solution.covariance(i, i) + relative * relative * mean * mean + least * least)};
  };
  auto lateness = lateness_.solve(); // of the change that the odometry reports, times its yaw scale
  lateness.mean[0] /= std::max(0.5, 1.0 + lateness.mean[1]);
  const auto turn = turn_.solve();
  return {.late_s = figure(lateness, 0, kNonlinearity, 0.0),
          .yaw_scale = figure(yaw_.solve(), 0, kOwnShare, 0.0),
          .lidar_turn_rad = {figure(turn, 0, kOwnShare, kLaserAngle_rad), figure(turn, 1, kOwnShare, kLaserAngle_rad),
                             figure(turn, 2, kOwnShare, kLaserAngle_rad)}};
}

void compare(const OdometryEstimate& estimate, std::size_t source, std::optional<OdometryComparison>& comparison) {
  const SourceReport& report = estimate.sources[source];
  if (!comparison && report.T_source_base)
    comparison.emplace();
  if (!comparison)
    return;
  if (report.T_source_base && !report.doubted && !estimate.failed && estimate.state == TrackingState::tracking)
    comparison->add(estimate.stamp, *report.T_source_base, estimate.twist_base);
  else
    comparison->interrupt();
}

} // namespace locus::daemon
