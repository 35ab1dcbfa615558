// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <vector>

#include "core/base/options.hpp"
#include "core/base/pose.hpp"
#include "core/map/registration.hpp"
#include "core/odometry/joint_covariance.hpp"
#include "core/odometry/learned_source.hpp"
#include "core/sources/motion_sample.hpp"
#include "core/sources/registration_feedback.hpp"
#include "core/sources/sensed_motion.hpp"

namespace locus {

/// Error-state Kalman filter on the manifold for the robot and its sensors, with one joint covariance.
///
/// Common states: pose at the end of the sweep (odom frame) against the submap, mean twist during it (base frame), bias
/// of the accelerometer, gravity, lever arm of the accelerometer, and error of the map since the start (considered).
/// Each gyro adds bias, lateness and mounting error; each odometry adds scales of forward distance and yaw, the
/// direction of its forward axis (left, up) and its slip.
///
/// Sequence for a sweep: predict(), measure() for each source or rest(), move(), update() with the registration,
/// learn(). The noise of each source is learned from its innovation against all others (variance components); an axis
/// that nothing else measures is skipped. Noise is per second, so the sweep rate does not matter. Copies of this value
/// type are hypotheses. Fixed size. One owner.
class MotionFilter {
 public:
  using State = JointCovariance::State;

  /// Axes of the twist that a source measures. The process noise for them is replaced by the acceleration limit,
  /// because a robot may brake harder than ever before.
  struct Measured {
    bool translation = false, rotation = false;
    bool slips = false; ///< a slip of the odometry begins: its forward speed is unknown until lidar measures it
  };

  explicit MotionFilter(const std::vector<MotionSourceOptions>& sources, const MotionLimits& limits = {});

  /// Restarts at a pose with a twist of standard deviation `twist_sigma`. `map_covariance`: pose covariance, since its
  /// start, of the map that another run left.
  void begin(const Pose& T_odom_base, const Vector6& twist_base, const Vector6& twist_sigma,
             const Matrix6& map_covariance = Matrix6::Zero());

  /// Predicts the twist during a sweep of `period_s` that ends `elapsed_s` after the last one. `force`: specific force,
  /// if an accelerometer measures it. `sensed_rate`: mean rate of its gyro since the last sweep (rad/s, base axes), the
  /// linearisation point; measure() applies it.
  void predict(double elapsed_s, double period_s, const std::optional<SpecificForce>& force, Measured measured,
               const std::optional<Eigen::Vector3d>& sensed_rate = std::nullopt);

  /// Predicts that the rate about the upward axis has changed by `change_radps`, give or take `sigma_radps`. The yaw at
  /// the end of the last sweep becomes uncertain, too, because the turn may have begun within it. Call before move().
  void expect_turn(double change_radps, double sigma_radps);

  /// Predicts zero velocity (paper II-B.2); the former prediction becomes uncertainty.
  void expect_rest();

  /// Updates with the mean twist of a source since the end of the last sweep (base axes).
  void measure(SourceId id, const SensedTwist& sensed, Measured what);
  /// Updates with zero twist.
  void rest();
  /// Integrates the twist to the pose at the end of the sweep.
  void move();

  /// Returns twice the negative log likelihood of a registration under the prediction, up to a constant: Student's t of
  /// its innovation in pose and twist, and Occam's factor for the directions that the points determine (MacKay 2003,
  /// 28.1). Call before update().
  [[nodiscard]] double surprise(const Registration& found) const;

  /// Returns the same of a standstill under the prediction, without Occam's factor: what the sources say against it.
  [[nodiscard]] double surprise_at_rest() const;

  /// Sets pose and twist to the registration's result, which includes the prior, and updates the covariance with
  /// `information`, that of the points alone.
  void update(const Pose& T_odom_base, const Vector6& twist_base, const Matrix12& information);

  /// Compares each measured source with all others, and learns its noise.
  void learn();

  /// Returns the innovation of a source, measured or not. Call after update(). A slip that the filter estimates is part
  /// of the innovation, unless `slip_explained`.
  [[nodiscard]] Innovation innovation(SourceId id, const SensedTwist& sensed, bool slip_explained = false) const;

  /// Returns how much a source contradicts the yaw rate: its squared Mahalanobis distance. A source is late by a share
  /// of the change of the rate since the last sweep. Gravity shows the other rates, of which odometries on legs have
  /// errors in common. Call after update().
  [[nodiscard]] double contradiction(SourceId id, const SensedTwist& sensed) const;

  /// Returns the prior odds, as twice their logarithm, that no slip begins in this sweep. Call after predict().
  [[nodiscard]] double odds_against_slip() const;

  /// Transfers `share` of the pose error, along each axis, to the error of the map. Call after a keyframe is inserted.
  void transfer_error_to_map(const Matrix6& share);
  /// Sets the pose and leaves the covariance unchanged.
  void set_pose(const Pose& T_odom_base);
  /// Resets calibration and noise of a source to their priors; lateness and mounting of a gyro keep their values.
  void reset_source(SourceId source);
  /// Restores the calibration that another run learned, which ended `elapsed_s` ago. Correlations with other states are
  /// dropped. States configured as exact keep their configured value.
  void recall(SourceId source, const LearnedSource& learned, double elapsed_s);
  [[nodiscard]] LearnedSource learned(SourceId source) const;

  [[nodiscard]] const Pose& pose() const { return T_odom_base_; }
  [[nodiscard]] const Vector6& twist_base() const { return twist_base_; }
  /// Returns pose and twist with their information as a prior for registration.
  [[nodiscard]] MotionBelief belief() const;
  [[nodiscard]] Matrix12 covariance() const { return P_.matrix().topLeftCorner<12, 12>(); } ///< pose (submap), twist
  [[nodiscard]] Matrix6 pose_covariance_since_start() const;
  [[nodiscard]] const State& state() const { return x_; } ///< states after the twist; for tests
  [[nodiscard]] int state_of(SourceId source) const { return sources_[index_of(source)].state; }

 private:
  using Common = JointCovariance::Common;

  struct Source {
    SourceKind kind = SourceKind::odometry;
    Eigen::Vector3d lever_m = Eigen::Vector3d::Zero(); ///< from the base to the source, as configured, in base axes
    int state = 0, states = 0;                         ///< offset and number of its states
    LearnedSource::States first, first_variance;       ///< their prior, as configured
    LearnedSource::States fades_per_s;                 ///< rate at which they revert to the prior
    std::optional<int> slip;                           ///< slip state of an odometry; momentary, not learned
    Vector6 first_noise_per_s;                         ///< prior of the noise
    Vector6 noise_per_s;                               ///< variance of the mean twist over one second
    Vector6 learned_s = Vector6::Zero();
    std::optional<Vector6> last_twist;
    bool used = false; ///< in the current sweep
    SensedTwist sensed = Vector6::Zero().eval();
    Vector6 variance = Vector6::Zero();       ///< variance applied; zero along axes that were not used
    Vector6 known_variance = Vector6::Zero(); ///< part of `variance` that is not learned

    [[nodiscard]] int lateness() const { return state + LearnedSource::kLate; }                     ///< of a gyro
    [[nodiscard]] Block<3> mounting() const { return {state + LearnedSource::kMounting}; }          ///< of a gyro
    [[nodiscard]] Block<4> lateness_and_mounting() const { return {state + LearnedSource::kLate}; } ///< of a gyro
    /// Returns the scale of an odometry for the forward speed (axis 0) or the yaw rate (axis 5).
    [[nodiscard]] int scale(int axis) const {
      return state + (axis == 0 ? LearnedSource::kScale : LearnedSource::kYawScale);
    }
  };

  /// Prediction of the twist: mean, variance of the noise, and Jacobians of the common states before the noise is added
  /// (F) and with respect to the new rate afterwards.
  struct TwistStep {
    Vector6 mean, variance;
    Common F = Common::Identity(), of_new_rate = Common::Identity();
  };
  // Process model: motion_filter_process.cpp
  [[nodiscard]] TwistStep decay(double elapsed_s, double step_s, double unmeasured_s, bool force_measured,
                                Measured measured);
  void integrate(const SpecificForce& force, double measured_s, const Eigen::Vector3d& new_rate, TwistStep& step) const;
  void couple_lateness(const SpecificForce& force);
  [[nodiscard]] Eigen::Vector3d force_change(const SpecificForce& force) const;
  void limit_speed();

  // Measurements: motion_filter_measurements.cpp
  struct Row { ///< measurement of one axis
    State h;
    double expected;
  };
  [[nodiscard]] Row gyro_row(const Source& gyro, const SensedTwist& sensed, int axis) const;
  [[nodiscard]] Row odometry_row(const Source& odometry, int axis) const;
  [[nodiscard]] Row row(const Source& source, const SensedTwist& sensed, int axis) const;
  [[nodiscard]] Vector6 known_variance(const Source& source, const Vector6& twist_base) const;
  double widen(Source& source, int axis, double ratio, double variance);
  void relinearise_scale(const Source& odometry, int axis, double change);

  // Calibration and noise of the sources: motion_filter_sources.cpp
  void add_source(const MotionSourceOptions& options, Source& source);
  void age(const Source& source, double elapsed_s);
  void revert(int state, double mean, double variance, double retained);
  void learn_noise(Source& source);

  // Filter: motion_filter.cpp
  void update_scalar(const State& h, double innovation, double variance);
  void correct(const State& error);
  [[nodiscard]] static State of_map(const State& Ph);
  [[nodiscard]] Matrix6 of_mounting() const;

  MotionLimits limits_;
  Vector6 acceleration_variance_; ///< acceleration variance, (m/s^2)^2 and (rad/s^2)^2
  std::array<Source, kMaxSources> sources_;
  std::size_t count_; ///< number of sources
  int states_ = JointCovariance::kCommonStates;
  Pose T_odom_start_, T_odom_base_;
  Vector6 twist_base_ = Vector6::Zero(), last_twist_base_ = Vector6::Zero(); ///< of this sweep and of the last one
  State x_; ///< states other than pose and twist; zero at the entries of those
  JointCovariance P_;
  double elapsed_s_ = 0.0; ///< time between the ends of the last two sweeps
  std::optional<SpecificForce> last_force_;
  Vector6 predicted_variance_ = Vector6::Zero(); ///< variance of the predicted twist
  Vector6 unobserved_s_ = Vector6::Zero();       ///< time since each axis of the twist was last observed
};

} // namespace locus
