// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string_view>
#include <vector>

#include "core/base/options.hpp"
#include "core/sources/health_metric.hpp"
#include "core/sources/motion_sample.hpp"
#include "core/sources/registration_feedback.hpp"
#include "core/sources/source_clock.hpp"
#include "core/sources/source_health.hpp"

namespace locus {

/// Decides sample by sample whether one motion source is trusted (paper II-B.1, health monitoring).
///
/// A sample that a metric rejects is dropped and counted. Without a good one for timeout() the source loses its health,
/// for the reason of the last rejection or, if nothing arrived, as stale: a single bad sample costs nothing, and a long
/// run of them no more than silence does. A source of which no sample has been good yet loses its health once the run
/// is worth telling. Good samples for kProbation restore the health, so a flapping sensor does not
/// flap the odometry. Reads no clock: the time comes from the samples and from advance(), in stamps of arrival. One
/// owner.
class HealthMonitor {
 public:
  static constexpr Duration kProbation = std::chrono::seconds{1};
  static constexpr Duration kShortestTimeout = std::chrono::milliseconds{50};
  static constexpr Duration kLongestTimeout = std::chrono::seconds{1};         ///< the paper's rate of 1 Hz
  static constexpr Duration kLongestImuPeriod = std::chrono::milliseconds{35}; ///< three samples in a sweep of 100 ms

  explicit HealthMonitor(const MotionSourceOptions& source, const MotionLimits& limits = {})
      : kind_(source.kind), metrics_(health_metrics(source, limits)) {}

  /// Return the instant of the measurement if the sample is accepted; nothing if it is rejected.
  std::optional<Stamp> judge(const ImuSample& sample);
  std::optional<Stamp> judge(const OdometrySample& sample);

  /// Sets the time: nothing has arrived until `now`.
  void advance(Stamp now);

  /// Processes lidar's feedback on this source.
  void on_feedback(LidarOpinion opinion, const RegistrationFeedback& feedback, Stamp now);

  /// Sets the external verdict on the health, valid until the next one.
  void set_outside_verdict(bool healthy, Stamp now);

  [[nodiscard]] bool healthy() const { return state_ == State::healthy; }
  /// Returns the number of losses of health. Samples of two epochs are not comparable: the time between was not
  /// monitored.
  [[nodiscard]] std::uint32_t epoch() const { return epoch_; }
  /// Returns the silence that costs the source its health: three of its own periods.
  [[nodiscard]] Duration timeout() const;
  /// Returns the period of its samples once it is known well, from fifty of them on.
  [[nodiscard]] std::optional<Duration> period() const;
  /// Returns whether an inertial unit samples too slowly to measure the motion within a sweep. It is healthy, but not
  /// used for that, and not compared with lidar: between two samples a gyro knows nothing of the motion.
  [[nodiscard]] bool is_too_slow() const {
    return kind_ == SourceKind::imu && from_seconds(period_s_) > kLongestImuPeriod;
  }
  /// Returns the finding about the source as a whole, in words for the user; empty if nothing is wrong.
  [[nodiscard]] std::string_view verdict() const;
  [[nodiscard]] bool trusts_accelerometer() const;
  /// Returns HealthMetric::gyro_axes().
  [[nodiscard]] std::optional<Eigen::Matrix3d> gyro_axes() const;
  /// Returns the present run of samples that are refused, or not used because the source is on probation; empty while
  /// it is healthy and before its first sample.
  [[nodiscard]] const std::optional<Refusal>& refusal() const { return refusal_; }
  /// Returns the longest such run so far, the present one included.
  [[nodiscard]] const Refusal& longest_refusal() const { return longest_refusal_; }
  /// Returns the arrival of the last good sample; Stamp{} before the first.
  [[nodiscard]] Stamp last_received() const { return last_arrival_; }
  /// Returns the latest change since the last call; the caller sets HealthEvent::source.
  std::optional<HealthEvent> pop_event();
  [[nodiscard]] const SourceCounters& counters() const { return counters_; }

 private:
  enum class State : std::uint8_t { never_received, healthy, lost, probation };

  std::optional<Stamp> judge(SourceReading reading);
  std::nullopt_t leave_out(HealthReason reason);
  std::nullopt_t refuse(HealthReason reason, Stamp arrival);
  void extend_refusal(HealthReason reason, Stamp arrival);
  void accept(const SourceReading& reading);
  void lose(HealthReason reason, Stamp now);
  void change(bool healthy, HealthReason reason, Stamp now);
  void learn_period(Duration step);

  SourceKind kind_;
  std::vector<std::unique_ptr<HealthMetric>> metrics_;
  SourceClock clock_;
  State state_ = State::never_received;
  std::uint32_t epoch_ = 0;
  bool outside_objects_ = false;
  std::optional<HealthReason> objection_; ///< latest rejection since the last good sample
  HealthReason lost_for_ = HealthReason::stale;
  std::optional<Refusal> refusal_;
  Refusal longest_refusal_;
  Stamp refused_since_;             ///< arrival of the first sample of refusal_
  Stamp last_stamp_, last_arrival_; ///< of the last good sample
  Stamp probation_since_;
  double period_s_ = 0.0; ///< learned; 0: not yet
  std::optional<HealthEvent> event_;
  SourceCounters counters_;
};

} // namespace locus
