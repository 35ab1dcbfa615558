// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "core/base/options.hpp"
#include "core/base/pose.hpp"
#include "core/map/registration.hpp"
#include "core/sources/motion_sample.hpp"
#include "core/sources/registration_feedback.hpp"
#include "core/sources/sensed_motion.hpp"

namespace locus {

/// A figure that is learned, and its standard deviation.
struct Learned {
  double mean = 0.0, sigma = 0.0;
};

/// What a filter has learned of a motion source, for the filter of another run to begin with. The states are its own:
/// three biases of a gyro, its lateness and the turn of its mounting, or two scales and two directions of an odometry.
struct LearnedSource {
  static constexpr int kMostStates = 7;
  using States = Eigen::Matrix<double, kMostStates, 1>; ///< an odometry has fewer; the rest is zero
  using Covariance = Eigen::Matrix<double, kMostStates, kMostStates>;
  static constexpr int kLate = 3, kMounting = 4;  ///< of a gyro, behind its biases
  static constexpr int kScale = 0, kYawScale = 1; ///< of an odometry

  Vector6 noise_per_s = Vector6::Zero(); ///< variance of its twist times seconds
  States states = States::Zero();
  Covariance covariance = Covariance::Zero();
  Stamp since{}; ///< end of the first sweep that told of it

  /// Of a gyro: for how long a sample is stamped after the motion that it tells of.
  [[nodiscard]] Learned lateness_s() const { return figure(kLate); }
  /// Of a gyro: by which turn about an axis of the base (0 to 2) it is mounted otherwise than configured.
  [[nodiscard]] Learned mounting_rad(int axis) const { return figure(kMounting + axis); }
  /// Of an odometry: how much more than the way ahead it reports, in parts of it; the same of the yaw.
  [[nodiscard]] Learned scale() const { return figure(kScale); }
  [[nodiscard]] Learned yaw_scale() const { return figure(kYawScale); }
  /// The way of the base, of the way that an odometry reports: wherever it went between, if it turned as it says.
  [[nodiscard]] Pose without_scale(const Pose& way) const;

 private:
  [[nodiscard]] Learned figure(int state) const {
    return {states[state], std::sqrt(std::max(0.0, covariance(state, state)))};
  }
};

/// What is known of a source before it is heard: its configuration and how sure that is.
LearnedSource as_configured(const MotionSourceOptions& source);

/// By the index of the source; nothing of those that were not heard.
using LearnedSources = std::array<std::optional<LearnedSource>, kMaxSources>;

/// The state of the robot and of its sensors with one covariance: an error-state Kalman filter on the manifold.
///
/// State: pose at the end of the sweep (odom frame) against the submap, twist during it (base frame, mean), bias of the
/// accelerometer, gravity, lever arm of the accelerometer, what the map is off since the start (considered), for each
/// gyro a bias, how late its samples
/// are stamped and by how much it is mounted askew, for each odometry a scale of the way ahead and one of the yaw, and
/// where it goes when it goes ahead (to the left, upwards), and how fast it slips. A sweep is predict(), measure() for
/// each source or rest(), move(), see() with what lidar found, and learn(). Noise of the sources is learned from the
/// innovations that each leaves when it is left out (variance components): what nothing else tells teaches nothing. All
/// of it is per second, so that the rate of the sweeps does not matter. A value: copies are hypotheses. Fixed size. One
/// owner.
class MotionFilter {
 public:
  static constexpr int kCommonStates = 27; ///< before those of the sources
  static constexpr int kMaxStates = kCommonStates + (LearnedSource::kMostStates + 1) * static_cast<int>(kMaxSources);
  using State = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, kMaxStates, 1>;
  using Common = Eigen::Matrix<double, kCommonStates, kCommonStates>;
  using Covariance = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, kMaxStates, kMaxStates>;

  /// Which axes of the twist a source measures. Those of the process are put aside for it: a robot may brake harder
  /// than it ever did.
  struct Measured {
    bool translation = false, rotation = false;
  };

  explicit MotionFilter(const std::vector<MotionSourceOptions>& sources, const MotionLimits& limits = {});

  /// Begins at a pose with a twist of which only `twist_sigma` (standard deviations) is known. `map_covariance`: of the
  /// map that another run has left, since its start.
  void begin(const Pose& T_odom_base, const Vector6& twist_base, const Vector6& twist_sigma,
             const Matrix6& map_covariance = Matrix6::Zero());

  /// The twist during a sweep of `period_s` whose end is `elapsed_s` after that of the last. `force`: where it is
  /// felt. `sensed_rate`: what its gyro reads (mean since the last sweep), to linearise about; measure() uses it.
  void predict(double elapsed_s, double period_s, const std::optional<SpecificForce>& force, Measured measured,
               const std::optional<Eigen::Vector3d>& sensed_rate = std::nullopt);

  /// Takes the robot to stand, as far as anything else is not told (paper II-B.2).
  void expect_rest();

  /// A source says that the base moved with a twist (mean, base axes) since the end of the last sweep.
  void measure(SourceId id, const SensedTwist& sensed, Measured what);
  /// The robot stands.
  void rest();
  /// The pose moves with the twist, to the end of the sweep.
  void move();

  /// Twice the negative log likelihood of a registration under the prediction, up to a constant: Student's t of how far
  /// it moves pose and twist, and Occam's factor of what the points determine (MacKay 2003, 28.1). Before see().
  [[nodiscard]] double surprise(const Registration& found) const;

  /// Lidar has placed the robot, with information that the points alone give.
  void see(const Pose& T_odom_base, const Vector6& twist_base, const Matrix12& information);

  /// Compares each source that was measured with all others, and learns its noise.
  void learn();

  /// Of any source, whether it was measured or not. After see().
  [[nodiscard]] Innovation innovation(SourceId id, const SensedTwist& sensed) const;

  /// The map has taken the sweep as it was placed: `share` of its error, along each axis, is now the map's.
  void keep(const Matrix6& share);
  /// Places the robot elsewhere without any news of how sure that is.
  void put(const Pose& T_odom_base);
  /// What comes back may come back as another.
  void forget(SourceId source);
  /// As another run has learned of it that ended `elapsed_s` ago, and back. Its correlations with the rest are left
  /// out, and what the user knows for sure stays as configured.
  void recall(SourceId source, const LearnedSource& learned, double elapsed_s);
  [[nodiscard]] LearnedSource learned(SourceId source) const;

  [[nodiscard]] const Pose& pose() const { return T_odom_base_; }
  [[nodiscard]] const Vector6& twist_base() const { return twist_base_; }
  /// What pose and twist are believed to be.
  [[nodiscard]] MotionBelief belief() const;
  [[nodiscard]] Matrix12 covariance() const { return P_.topLeftCorner<12, 12>(); } ///< pose against the submap
  [[nodiscard]] Matrix6 pose_covariance_since_start() const;
  [[nodiscard]] const State& state() const { return x_; } ///< behind the twist, for tests
  [[nodiscard]] int state_of(SourceId source) const { return sources_[index_of(source)].state; }

 private:
  struct Source {
    SourceKind kind = SourceKind::odometry;
    Eigen::Vector3d lever_m = Eigen::Vector3d::Zero(); ///< from the base to it, as configured
    int state = 0, states = 0;                         ///< first of its own, and how many
    LearnedSource::States first, first_variance;       ///< of these: as configured
    LearnedSource::States fades_per_s;                 ///< how quickly they come back to it
    std::optional<int> slip;                           ///< of an odometry, its state: of the moment, not learned
    Vector6 noise_per_s;                               ///< variance of the twist times seconds
    Vector6 learned_s = Vector6::Zero();
    std::optional<Vector6> last_twist;
    bool used = false; ///< in the sweep at hand
    SensedTwist sensed = Vector6::Zero().eval();
    Vector6 variance = Vector6::Zero();       ///< that it was used with; zero along axes that were not
    Vector6 known_variance = Vector6::Zero(); ///< the part of it that is not learned
  };

  /// Prediction of the twist: its mean, Jacobians with respect to the common states before the noise is added and to
  /// the new rate afterwards, and the variance of the noise.
  struct TwistStep {
    Vector6 mean, variance;
    Common F = Common::Identity(), of_new_rate = Common::Identity();
  };
  [[nodiscard]] TwistStep decay(double elapsed_s, double step_s, double unfelt_s, bool felt, Measured measured);
  void integrate(const SpecificForce& force, double felt_s, const Eigen::Vector3d& new_rate, TwistStep& step) const;
  void couple_lateness(const SpecificForce& force);
  [[nodiscard]] Eigen::Vector3d force_change(const SpecificForce& force) const;

  struct Row { ///< of a measurement of one axis
    State h;
    double expected;
  };
  [[nodiscard]] Row row(const Source& source, const SensedTwist& sensed, int axis) const;
  [[nodiscard]] Vector6 known_variance(const Source& source, const Vector6& twist_base) const;
  void propagate(const Common& F);
  void update(const State& h, double surprise, double variance);
  void correct(const State& error);
  void lower(const State& Ph, const State& considered, double innovation_variance);
  [[nodiscard]] static State of_map(const State& Ph);
  void turn_scale(int scale, int axis, double change);
  void learn_source(Source& source);
  void age(const Source& source, double elapsed_s);
  void wander(int state, double mean, double variance, double kept);
  [[nodiscard]] Matrix6 of_mounting() const;
  void limit_speed();
  void keep_floor();

  MotionLimits limits_;
  Vector6 able_; ///< what the robot is able to, one standard deviation: m/s^2 and rad/s^2, squared
  std::array<Source, kMaxSources> sources_;
  std::size_t count_; ///< of sources
  int states_ = kCommonStates;
  Pose T_odom_start_, T_odom_base_;
  Vector6 twist_base_ = Vector6::Zero();
  State x_; ///< all that is neither pose nor twist; zero there
  Covariance P_;
  double elapsed_s_ = 0.0; ///< between the ends of the last two sweeps
  std::optional<SpecificForce> last_force_;
  Vector6 predicted_variance_ = Vector6::Zero(); ///< of the twist
  Vector6 untold_s_ = Vector6::Zero();           ///< for how long nobody has told of an axis of the twist
};

} // namespace locus
