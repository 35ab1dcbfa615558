// SPDX-License-Identifier: Apache-2.0
#include "core/sources/health_metric.hpp"

#include <algorithm>

#include "core/sources/imu_self_check.hpp"
#include "core/sources/motion_track.hpp"

namespace locus {

namespace {

std::optional<HealthReason> reason_if(bool wrong, HealthReason reason) {
  return wrong ? std::optional{reason} : std::nullopt;
}

/// Rejects NaN and values beyond the reach of any robot or sensor, since sums would never recover from either, and
/// quaternions that are no rotation.
class NotANumber : public HealthMetric {
 public:
  explicit NotANumber(UseAcceleration use_acceleration) : use_acceleration_(use_acceleration) {}

  std::optional<HealthReason> judge(const SourceReading& reading) override {
    if (!(reading.imu != nullptr ? is_number(*reading.imu) : is_number(*reading.odometry)))
      return HealthReason::nan;
    return reason_if(reading.odometry != nullptr && !rotates(reading.odometry->T_source_base.rotation),
                     HealthReason::no_rotation);
  }

 private:
  [[nodiscard]] bool is_number(const ImuSample& sample) const {
    constexpr double kMost = 1e5; ///< deg/s and milli-g pass, for ImuSelfCheck to identify them
    return is_within(kMost, sample.angular_velocity_radps) &&
           (use_acceleration_ == UseAcceleration::off || is_within(kMost, sample.specific_force_mps2)) &&
           (!sample.attitude || sample.attitude->coeffs().allFinite());
  }
  static bool is_number(const OdometrySample& sample) {
    constexpr double kFarthest_m = 1e8; ///< geocentric coordinates are within it
    return is_within(kFarthest_m, sample.T_source_base.translation) && sample.T_source_base.finite();
  }
  /// Tells whether the quaternion is a rotation. One without w is none, though it is of unit length at half a turn.
  bool rotates(const Eigen::Quaterniond& quaternion) {
    if (quaternion.w() != 0.0)
      lacks_w_ = false;
    else if (!is_rotation(quaternion))
      lacks_w_ = true;
    return !lacks_w_ && is_rotation(quaternion);
  }
  static bool is_within(double most, const Eigen::Vector3d& v) { return (v.array().abs() <= most).all(); }

  UseAcceleration use_acceleration_;
  bool lacks_w_ = false;
};

class OutOfOrder : public HealthMetric {
 public:
  std::optional<HealthReason> judge(const SourceReading& reading) override {
    return reason_if(newest_ && reading.stamp <= *newest_, HealthReason::out_of_order);
  }
  void accept(const SourceReading& reading) override { newest_ = reading.stamp; }
  void reset() override { newest_.reset(); }

 private:
  std::optional<Stamp> newest_;
};

/// Rejects late samples: one beyond the limit of extrapolation is of little use to its sweep.
class Late : public HealthMetric {
 public:
  std::optional<HealthReason> judge(const SourceReading& reading) override {
    constexpr Duration kMaxLatency = std::chrono::milliseconds{100};
    return reason_if(reading.arrival - reading.stamp > kMaxLatency, HealthReason::stale);
  }
};

class Uncertain : public HealthMetric {
 public:
  std::optional<HealthReason> judge(const SourceReading& reading) override {
    constexpr double kMaxScale = 4.0; ///< twice the usual standard deviation
    return reason_if(reading.odometry->covariance_scale > kMaxScale, HealthReason::covariance);
  }
};

/// Distinguishes a frozen unit from a robot at rest. Readings of a live inertial unit are never identical to the last
/// bit, unless it has no noise, and then its turn rate at rest is zero. Zeros alone are no reading of a unit that has
/// measured forces.
class FrozenImu : public HealthMetric {
 public:
  std::optional<HealthReason> judge(const SourceReading& reading) override {
    const ImuSample& now = *reading.imu;
    const bool turns = !now.angular_velocity_radps.isZero(0), has_force = !now.specific_force_mps2.isZero(0);
    const bool repeats = last_ && last_->angular_velocity_radps == now.angular_velocity_radps &&
                         last_->specific_force_mps2 == now.specific_force_mps2;
    return reason_if((repeats && turns) || (measures_force_ && !turns && !has_force), HealthReason::frozen);
  }
  void accept(const SourceReading& reading) override {
    last_ = *reading.imu;
    measures_force_ = measures_force_ || !last_->specific_force_mps2.isZero(0);
  }

 private:
  std::optional<ImuSample> last_;
  bool measures_force_ = false;
};

/// Detects an accelerometer that repeats its reading while the gyro beside it is alive: its forces are not used until
/// they have changed for a second. An accelerometer that is sampled less often than the gyro repeats its readings for a
/// few samples; a robot at rest and without noise repeats those of both.
class FrozenAccelerometer : public HealthMetric {
 public:
  void accept(const SourceReading& reading) override {
    const Duration step = last_ ? reading.stamp - last_stamp_ : Duration{};
    const bool is_alive = last_ && last_->angular_velocity_radps != reading.imu->angular_velocity_radps;
    if (last_ && last_->specific_force_mps2 != reading.imu->specific_force_mps2)
      repeats_for_ = Duration{};
    else if (is_alive)
      repeats_for_ += step;
    changes_for_ = repeats_for_ > kLongest ? Duration{} : changes_for_ + step;
    frozen_ = repeats_for_ > kLongest || (frozen_ && changes_for_ < kChangesFor);
    last_ = *reading.imu;
    last_stamp_ = reading.stamp;
  }
  void reset() override { last_.reset(); }

  [[nodiscard]] std::string_view verdict() const override {
    return frozen_ ? "repeats one acceleration while its turn rates change: its accelerations are not used (possible "
                     "causes: its driver, or a simulation that sets gravity alone)"
                   : std::string_view{};
  }
  [[nodiscard]] bool trusts_accelerometer() const override { return !frozen_; }

 private:
  static constexpr Duration kLongest = std::chrono::milliseconds{200}, kChangesFor = std::chrono::seconds{1};

  std::optional<ImuSample> last_;
  Stamp last_stamp_;
  Duration repeats_for_{}, changes_for_{};
  bool frozen_ = false;
};

/// Detects a frozen odometry. An odometry repeats its pose while the robot stands; it is frozen if it was moving fast
/// at the previous sample, since no robot stops like that, or if lidar continues to observe motion. One with dead
/// encoders beside a live gyro repeats its position alone; it is frozen if lidar observes a translation.
class FrozenOdometry : public HealthMetric {
 public:
  explicit FrozenOdometry(double hardest_mps2) : hardest_mps2_(hardest_mps2) {}

  std::optional<HealthReason> judge(const SourceReading& reading) override {
    const Pose& T_source_base = reading.odometry->T_source_base;
    if (!last_ || T_source_base.translation != last_->translation)
      position_.restart();
    if (!last_ || T_source_base != *last_)
      pose_.restart();
    else if (reading.stamp < pose_.since) { // a clock was set back: time at rest unknown
      pose_.since = reading.stamp;
      twist_.setZero();
    }
    const bool repeats_pose = last_ && T_source_base == *last_;
    position_.frozen = position_.frozen || position_.lidar_translates();
    pose_.frozen = pose_.frozen || pose_.lidar_translates() || pose_.lidar_rotates() ||
                   (repeats_pose && cannot_stop_within(reading.stamp - pose_.since));
    return reason_if(pose_.frozen || position_.frozen, HealthReason::frozen);
  }

  void accept(const SourceReading& reading) override {
    const Pose& T_source_base = reading.odometry->T_source_base;
    if (last_ && T_source_base == *last_)
      return;
    if (last_ && reading.stamp - pose_.since >= MotionTrack::kShortestBaseline)
      twist_ = se3_log(last_->inverse() * T_source_base) / to_seconds(reading.stamp - pose_.since);
    if (!last_ || T_source_base.translation != last_->translation)
      position_.since = reading.stamp;
    pose_.since = reading.stamp;
    last_ = T_source_base;
  }

  std::optional<HealthReason> on_feedback(LidarOpinion, const RegistrationFeedback& feedback) override {
    pose_.add(feedback);
    position_.add(feedback);
    return std::nullopt;
  }

 private:
  /// A reading that repeats, and the motion that lidar observes meanwhile.
  struct Repeated {
    Stamp since; ///< its last change
    bool frozen = false;
    Vector6 twist = Vector6::Zero();
    Vector6 path = Vector6::Zero(); ///< m and rad

    void restart() { *this = {since}; }
    void add(const RegistrationFeedback& feedback) {
      if (feedback.from < since) // outdated: it was still changing then
        return;
      twist = feedback.twist_base;
      path += to_seconds(feedback.to - feedback.from) * feedback.twist_base;
    }
    [[nodiscard]] bool lidar_translates() const { return moves(twist.head<3>(), path.head<3>()); }
    [[nodiscard]] bool lidar_rotates() const { return moves(twist.tail<3>(), path.tail<3>()); }
    /// Tells whether the motion is farther than a wrong gyro shakes a sweep or two.
    static bool moves(const Eigen::Vector3d& rate, const Eigen::Vector3d& distance) {
      constexpr double kMoves = 0.2, kFor_s = 0.3; // m/s or rad/s
      return rate.norm() > kMoves && distance.norm() > kFor_s * kMoves;
    }
  };

  [[nodiscard]] bool cannot_stop_within(Duration duration) const {
    constexpr double kHardest_radps2 = 20.0;
    const double duration_s = to_seconds(duration);
    return twist_.head<3>().norm() > hardest_mps2_ * duration_s ||
           twist_.tail<3>().norm() > kHardest_radps2 * duration_s;
  }

  double hardest_mps2_;
  std::optional<Pose> last_;        ///< latest accepted pose that differed from the previous one
  Vector6 twist_ = Vector6::Zero(); ///< before it
  Repeated pose_, position_;
};

/// Rejects a turn rate that no robot has.
class ImpossibleTurnRate : public HealthMetric {
 public:
  std::optional<HealthReason> judge(const SourceReading& reading) override {
    constexpr double kMax_radps = 12.0; ///< two turns a second; a gyro in deg/s soon exceeds it
    return reason_if(reading.imu->angular_velocity_radps.norm() > kMax_radps, HealthReason::jump);
  }
};

/// Rejects a pose that is not continuous with the last ones: reaching it would require an impossible change of speed or
/// turn rate.
class PoseJump : public HealthMetric {
 public:
  std::optional<HealthReason> judge(const SourceReading& reading) override {
    constexpr double kMaxChange_mps = 5.0, kMaxChange_radps = 5.0;
    constexpr double kAlwaysAllowed_m = 0.05, kAlwaysAllowed_rad = 0.05; ///< corrections of a visual odometry
    if (!last_ || !moving_)
      return std::nullopt;
    const double step_s = to_seconds(reading.stamp - last_stamp_);
    const Pose T_expected_base = (*last_ * se3_exp(step_s * twist_)).inverse() * reading.odometry->T_source_base;
    return reason_if(T_expected_base.translation.norm() > std::max(kAlwaysAllowed_m, kMaxChange_mps * step_s) ||
                         angle_rad(T_expected_base.rotation.normalized()) >
                             std::max(kAlwaysAllowed_rad, kMaxChange_radps * step_s),
                     HealthReason::jump);
  }
  /// Updates the velocity from samples far enough apart; those between them are compared with its prediction.
  void accept(const SourceReading& reading) override {
    if (last_ && reading.stamp - last_stamp_ < MotionTrack::kShortestBaseline)
      return;
    const Pose& T_source_base = reading.odometry->T_source_base;
    moving_ = last_.has_value();
    if (moving_)
      twist_ = se3_log(last_->inverse() * T_source_base) / to_seconds(reading.stamp - last_stamp_);
    last_ = T_source_base;
    last_stamp_ = reading.stamp;
  }
  void reset() override { last_.reset(); }

 private:
  std::optional<Pose> last_;
  Stamp last_stamp_;
  bool moving_ = false; ///< twist_ is valid
  Vector6 twist_ = Vector6::Zero();
};

/// Rejects a speed above the robot's limit.
class ImpossibleSpeed : public HealthMetric {
 public:
  explicit ImpossibleSpeed(double max_mps) : max_mps_(max_mps) {}

  std::optional<HealthReason> judge(const SourceReading& reading) override {
    constexpr double kNoise_m = 0.05, kJitter_s = 0.03; ///< of positions and stamps
    if (!last_)
      return std::nullopt;
    const double way_m = (reading.odometry->T_source_base.translation - last_->translation).norm();
    const double time_s = kJitter_s + to_seconds(reading.stamp - last_stamp_);
    return reason_if(way_m > kNoise_m + max_mps_ * time_s, HealthReason::speed);
  }
  void accept(const SourceReading& reading) override {
    constexpr Duration kBaseline = std::chrono::milliseconds{500};
    if (last_ && reading.stamp - last_stamp_ < kBaseline)
      return;
    last_ = reading.odometry->T_source_base;
    last_stamp_ = reading.stamp;
  }
  void reset() override { last_.reset(); }

 private:
  double max_mps_;
  std::optional<Pose> last_;
  Stamp last_stamp_;
};

/// Rejects a source whose motion differs from lidar's in several consecutive sweeps.
class LidarDisagrees : public HealthMetric {
 public:
  std::optional<HealthReason> on_feedback(LidarOpinion opinion, const RegistrationFeedback&) override {
    constexpr int kSweepsInARow = 3;
    if (opinion == LidarOpinion::none)
      return std::nullopt;
    disagreements_ = opinion == LidarOpinion::disagrees ? disagreements_ + 1 : 0;
    return reason_if(disagreements_ >= kSweepsInARow, HealthReason::disagreement);
  }

 private:
  int disagreements_ = 0;
};

} // namespace

std::vector<std::unique_ptr<HealthMetric>> health_metrics(const MotionSourceOptions& source,
                                                          const MotionLimits& limits) {
  std::vector<std::unique_ptr<HealthMetric>> metrics;
  metrics.push_back(
      std::make_unique<NotANumber>(source.use_acceleration)); // first, so that the others need not check for it
  metrics.push_back(std::make_unique<Late>());
  metrics.push_back(std::make_unique<OutOfOrder>());
  if (source.kind == SourceKind::imu) {
    metrics.push_back(std::make_unique<FrozenImu>());
    metrics.push_back(
        std::make_unique<ImuSelfCheck>(source.T_base_source, source.use_acceleration)); // must get turn rates in deg/s
    if (source.use_acceleration == UseAcceleration::automatic)
      metrics.push_back(std::make_unique<FrozenAccelerometer>());
    metrics.push_back(std::make_unique<ImpossibleTurnRate>());
  } else {
    metrics.push_back(std::make_unique<Uncertain>());
    metrics.push_back(std::make_unique<FrozenOdometry>(limits.max_acceleration_mps2));
    metrics.push_back(std::make_unique<PoseJump>());
    metrics.push_back(std::make_unique<ImpossibleSpeed>(limits.max_speed_mps));
  }
  metrics.push_back(std::make_unique<LidarDisagrees>());
  return metrics;
}

} // namespace locus
