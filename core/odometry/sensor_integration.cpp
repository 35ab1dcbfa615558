// SPDX-License-Identifier: Apache-2.0
#include "core/odometry/sensor_integration.hpp"

#include <algorithm>
#include <utility>

#include "core/sources/motion_sources.hpp"

namespace locus {

namespace {

/// Motion sources that see no more than this see a robot at rest.
constexpr double kRest_mps = 0.03;
constexpr double kRest_radps = 0.02;

/// A robot accelerates by 4 m/s^2 and 2 rad/s^2 in a sweep; standing must not teach that it lasts.
const PriorExpectation kConstantVelocity{
    .sigma = along_each_axis(0.3, 3.0), .bias = along_each_axis(0.3, 3.0), .least_sigma = along_each_axis(0.02, 0.5)};
const PriorExpectation kOdometrySource{.sigma = along_each_axis(0.02, 0.5),
                                       .bias = along_each_axis(0.005, 0.1),
                                       .least_sigma = along_each_axis(0.002, 0.02)};
const PriorExpectation kInertialUnit{.sigma = along_each_axis(0.3, 0.1),
                                     .bias = along_each_axis(0.3, 0.05),
                                     .least_sigma = along_each_axis(0.002, 0.02)};
const Vector6 kUnknownMotion = along_each_axis(3.0, 10.0); ///< per sweep, of a robot of which nothing is known

/// So many sweeps of lidar tell more of a gyro than wheels ever do.
constexpr int kTaught_sweeps = 20;

} // namespace

SensorIntegration::SensorIntegration(const OdometryOptions& options, std::vector<MotionSourceOptions> sources)
    : sources_(std::move(sources)), fusion_(options.fusion), no_source_prior_(options.no_source_prior),
      constant_velocity_statistics_(kConstantVelocity), gyro_biases_(sources_.size()), gyro_scales_(sources_.size()) {
  for (const MotionSourceOptions& source : sources_)
    statistics_.emplace_back(source.kind == SourceKind::imu ? kInertialUnit : kOdometrySource);
}

MotionPrior SensorIntegration::integrate(const Sweep& sweep, const std::optional<Vector6>& twist_base,
                                         std::optional<SourceId> without) const {
  MotionPrior prior;
  const double elapsed = elapsed_s(sweep);
  const double periods = last_period_ > Duration::zero() ? std::max(1.0, elapsed / to_seconds(last_period_)) : 1.0;
  const bool keeps_velocity = no_source_prior_ == NoSourcePrior::constant_velocity && elapsed > 0.0;
  if (twist_base)
    prior.T_last_kept = se3_exp(elapsed * *twist_base);
  if (keeps_velocity)
    prior.T_last_now = prior.T_last_kept;
  prior.blind = !twist_base;
  prior.variance = prior.blind ? kUnknownMotion.cwiseAbs2().eval() : constant_velocity_statistics_.variance(periods);
  prior.bias = prior.variance.cwiseSqrt(); // who goes on as before errs more the longer it does

  const auto kind_of = [this](SourceId source) { return sources_[index_of(source)].kind; };
  const auto usable = [&](SourceId source) {
    return source != without && sweep.motion.sources[index_of(source)].usable &&
           last_sources_[index_of(source)].usable && step(sweep, source);
  };
  const SourceChoice choice = choose_sources(kind_of, sources_.size(), fusion_, usable);
  prior.source = {choice, keeps_velocity ? NoSourcePrior::constant_velocity : NoSourcePrior::identity};
  if (choice.rotation) {
    const std::size_t i = index_of(*choice.rotation);
    prior.T_last_now.rotation = step(sweep, *choice.rotation)->rotation;
    prior.variance.tail<3>() = statistics_[i].variance(periods).tail<3>();
    if (sources_[i].kind == SourceKind::imu)
      prior.variance.tail<3>() += gyro_scales_[i].variance(so3_log(prior.T_last_now.rotation));
    prior.bias.tail<3>() = statistics_[i].bias(periods).tail<3>();
  }
  if (choice.translation) {
    const std::size_t i = index_of(*choice.translation);
    prior.T_last_now.translation = step(sweep, *choice.translation)->translation;
    prior.variance.head<3>() = statistics_[i].variance(periods).head<3>();
    prior.bias.head<3>() = statistics_[i].bias(periods).head<3>();
    prior.blind = false;
  }
  return prior;
}

/// T_last_now as one source saw it, less what is known of its error; nothing where it does not know.
std::optional<Pose> SensorIntegration::step(const Sweep& sweep, SourceId source) const {
  const SourcePose& last = last_sources_[index_of(source)];
  const SourcePose& now = sweep.motion.sources[index_of(source)];
  if (!last.known || !now.known || last.epoch != now.epoch)
    return std::nullopt;
  Pose T_last_now = last.T_source_base.inverse() * now.T_source_base;
  if (sources_[index_of(source)].kind == SourceKind::imu)
    T_last_now.rotation =
        T_last_now.rotation * so3_exp(-gyro_biases_[index_of(source)].turn_rad(sweep.end - last_stamp_));
  return T_last_now;
}

std::optional<Pose> SensorIntegration::healthy_step(const Sweep& sweep, SourceId source) const {
  return sweep.motion.sources[index_of(source)].usable ? step(sweep, source) : std::nullopt;
}

bool SensorIntegration::saw_motion(const Sweep& sweep) const {
  const double elapsed = elapsed_s(sweep);
  for (std::size_t i = 0; i < sources_.size(); ++i) {
    const std::optional<Pose> T_last_now = healthy_step(sweep, SourceId{i});
    if (T_last_now && (T_last_now->translation.norm() > kRest_mps * elapsed ||
                       angle_rad(T_last_now->rotation) > kRest_radps * elapsed))
      return true;
  }
  return false;
}

/// A source that is in agreement teaches its statistics; one in disagreement would only teach them to expect the worst.
/// Standing must not teach that it lasts.
std::array<LidarOpinion, kMaxSources> SensorIntegration::judge(const Sweep& sweep, const MotionPrior& prior,
                                                               const SeenMotion& found, const SeenAxes& axes) {
  std::array<LidarOpinion, kMaxSources> opinions{};
  judged_sweeps_ = std::min(judged_sweeps_ + 1, kTaught_sweeps);
  Matrix6 information = axes.rows_of(found.information);
  for (std::size_t i = 0; i < sources_.size(); ++i) {
    const std::optional<Pose> T_last_predicted = step(sweep, SourceId{i});
    if (!T_last_predicted)
      continue;
    const bool imu = sources_[i].kind == SourceKind::imu;
    Matrix6 seen = information;
    if (imu)
      seen.topRows<3>().setZero(); // knows nothing of translation
    const Vector6 error = difference(found.T_last_now, *T_last_predicted);
    opinions[i] = opinion_on(error, seen);
    if (opinions[i] == LidarOpinion::disagrees)
      continue;
    if (!found.stands)
      statistics_[i].learn(error, seen);
    if (imu) {
      gyro_biases_[i].learn(-error.tail<3>(), so3_log(found.T_last_now.rotation), sweep.end - last_stamp_);
      gyro_scales_[i].learn(-axes.part_of(error).tail<3>(), axes.part_of(se3_log(*T_last_predicted)).tail<3>());
    }
  }
  if (found.stands)
    return opinions;
  if (prior.source.translation) { // a robot that drove gently may yet turn sharply: lidar will see that it does
    information.setZero();
    information.diagonal().head<3>() = prior.variance.head<3>().cwiseInverse();
  }
  constant_velocity_statistics_.learn(difference(found.T_last_now, prior.T_last_kept), information);
  return opinions;
}

void SensorIntegration::judge_blind(const Sweep& sweep) {
  if (judged_sweeps_ >= kTaught_sweeps)
    return;
  const auto turn = [&](std::size_t i) -> std::optional<Eigen::Vector3d> {
    const std::optional<Pose> T_last_now = healthy_step(sweep, SourceId{i});
    return T_last_now ? std::optional{so3_log(T_last_now->rotation)} : std::nullopt;
  };
  std::optional<Eigen::Vector3d> true_turn_rad;
  for (std::size_t i = 0; i < sources_.size() && !true_turn_rad; ++i)
    if (sources_[i].kind == SourceKind::odometry)
      true_turn_rad = turn(i);
  for (std::size_t i = 0; i < sources_.size() && true_turn_rad; ++i)
    if (const auto turn_rad = sources_[i].kind == SourceKind::imu ? turn(i) : std::nullopt)
      gyro_biases_[i].learn(*turn_rad - *true_turn_rad, *true_turn_rad, sweep.end - last_stamp_);
}

void SensorIntegration::remember(const Sweep& sweep) {
  last_stamp_ = sweep.end;
  last_period_ = sweep.end - sweep.start;
  for (std::size_t i = 0; i < gyro_scales_.size(); ++i)
    if (!sweep.motion.sources[i].usable) // what comes back may come back as another
      gyro_scales_[i] = GyroScale{};
  last_sources_ = sweep.motion.sources;
}

} // namespace locus
