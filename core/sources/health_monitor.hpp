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

/// Decides sample by sample whether one motion source is to be trusted (paper II-B.1, health monitoring).
///
/// A sample to which a metric objects is left out and counted. Without a good one for timeout() the source loses its
/// health, for the reason of the last objection or, if nothing came at all, as stale: so one bad sample costs nothing,
/// and a long row of them no more than silence does. Good samples for kProbation give the health back, so a flapping
/// sensor does not flap the odometry. Knows the time from the samples and from advance() alone, in stamps of arrival.
/// One owner.
class HealthMonitor {
 public:
  static constexpr Duration kProbation = std::chrono::seconds{1};
  static constexpr Duration kShortestTimeout = std::chrono::milliseconds{50};
  static constexpr Duration kLongestTimeout = std::chrono::seconds{1}; ///< the paper's rate of 1 Hz

  explicit HealthMonitor(const MotionSourceOptions& source, const MotionLimits& limits = {})
      : metrics_(health_metrics(source, limits)) {}

  /// The instant of the measurement if the sample may be used; nothing if it is left out.
  std::optional<Stamp> judge(const ImuSample& sample);
  std::optional<Stamp> judge(const OdometrySample& sample);

  /// Nothing has come until `now`.
  void advance(Stamp now);

  /// What lidar saw in the meantime, and says of this source.
  void hear(LidarOpinion opinion, const RegistrationFeedback& feedback, Stamp now);

  /// Health as judged elsewhere, until the next word.
  void set_outside_verdict(bool healthy, Stamp now);

  [[nodiscard]] bool healthy() const { return state_ == State::healthy; }
  /// Counts losses of health. Samples of two epochs are not to be compared: what lies between was not watched.
  [[nodiscard]] std::uint32_t epoch() const { return epoch_; }
  /// Silence that costs the source its health: three of its own periods.
  [[nodiscard]] Duration timeout() const;
  /// What is wrong with the source as a whole, in words for the user; empty if nothing is.
  [[nodiscard]] std::string_view verdict() const;
  [[nodiscard]] bool trusts_accelerometer() const;
  /// When the last good sample arrived; Stamp{} before the first.
  [[nodiscard]] Stamp last_heard() const { return last_arrival_; }
  /// The latest change since the last call; HealthEvent::source is left to the caller.
  std::optional<HealthEvent> take_event();
  [[nodiscard]] const SourceCounters& counters() const { return counters_; }

 private:
  enum class State : std::uint8_t { unheard, healthy, lost, probation };

  std::optional<Stamp> judge(SourceReading reading);
  std::nullopt_t leave_out(HealthReason reason);
  void accept(const SourceReading& reading);
  void lose(HealthReason reason, Stamp now);
  void change(bool healthy, HealthReason reason, Stamp now);
  void learn_period(Duration step);

  std::vector<std::unique_ptr<HealthMetric>> metrics_;
  SourceClock clock_;
  State state_ = State::unheard;
  std::uint32_t epoch_ = 0;
  bool outside_objects_ = false;
  std::optional<HealthReason> objection_; ///< the last one since the last good sample
  HealthReason lost_for_ = HealthReason::stale;
  Stamp last_stamp_, last_arrival_; ///< of the last good sample
  Stamp probation_since_;
  double period_s_ = 0.0; ///< learned; 0: not yet
  std::optional<HealthEvent> event_;
  SourceCounters counters_;
};

} // namespace locus
