// SPDX-License-Identifier: Apache-2.0
#include "core/sources/health_monitor.hpp"

#include <algorithm>
#include <utility>

namespace locus {

namespace {

constexpr double kPeriodsOfSilence = 3.0;
constexpr double kPeriodMemory_samples = 32.0;

} // namespace

std::optional<Stamp> HealthMonitor::judge(const ImuSample& sample) {
  return judge(SourceReading{.stamp = sample.stamp, .arrival = sample.arrival, .imu = &sample});
}

std::optional<Stamp> HealthMonitor::judge(const OdometrySample& sample) {
  return judge(SourceReading{.stamp = sample.stamp, .arrival = sample.arrival, .odometry = &sample});
}

std::optional<Stamp> HealthMonitor::judge(SourceReading reading) {
  if (state_ != State::never_received &&
      reading.arrival < last_arrival_ - kLongestTimeout) { // the host's clock was set back
    lose(HealthReason::out_of_order, reading.arrival);
    last_arrival_ = reading.arrival;
  }
  advance(reading.arrival);
  ++counters_.received;
  const std::optional<Stamp> stamp = clock_.on_host_clock(reading.stamp, reading.arrival);
  if (clock_.steps() != counters_.clock_steps)
    lose(HealthReason::out_of_order, reading.arrival); // the duration of the step is unknown
  counters_.clock_steps = clock_.steps();
  if (!stamp)
    return refuse(HealthReason::out_of_order, reading.arrival);
  reading.stamp = *stamp;
  if (outside_objects_)
    return refuse(HealthReason::outside, reading.arrival);
  for (const auto& metric : metrics_) {
    if (const auto reason = metric->judge(reading))
      return refuse(*reason, reading.arrival);
  }
  accept(reading);
  return stamp;
}

std::nullopt_t HealthMonitor::leave_out(HealthReason reason) {
  ++counters_.rejected[static_cast<std::size_t>(reason)];
  objection_ = reason;
  return std::nullopt;
}

/// Leaves a sample out.
std::nullopt_t HealthMonitor::refuse(HealthReason reason, Stamp arrival) {
  leave_out(reason);
  extend_refusal(reason, arrival);
  if (state_ == State::never_received && refusal_->is_worth_reporting())
    lose(reason, arrival);
  return std::nullopt;
}

/// Follows how long the source has not been used although it sends samples.
void HealthMonitor::extend_refusal(HealthReason reason, Stamp arrival) {
  if (!refusal_)
    refused_since_ = arrival;
  refusal_ = {reason, std::max(arrival - refused_since_, Duration{})};
  if (refusal_->lasted > longest_refusal_.lasted)
    longest_refusal_ = *refusal_;
}

void HealthMonitor::accept(const SourceReading& reading) {
  for (const auto& metric : metrics_)
    metric->accept(reading);
  if (state_ != State::never_received)
    learn_period(reading.stamp - last_stamp_);
  last_stamp_ = reading.stamp;
  last_arrival_ = reading.arrival;
  objection_.reset();
  if (state_ == State::never_received) {
    state_ = State::healthy;
  } else if (state_ == State::lost) {
    state_ = State::probation;
    probation_since_ = reading.arrival;
  } else if (state_ == State::probation && reading.arrival - probation_since_ >= kProbation) {
    state_ = State::healthy;
    change(true, lost_for_, reading.arrival);
  }
  if (state_ == State::healthy)
    refusal_.reset();
  else
    extend_refusal(lost_for_, reading.arrival);
}

void HealthMonitor::advance(Stamp now) {
  if (state_ == State::never_received || state_ == State::lost || now - last_arrival_ <= timeout())
    return;
  if (!objection_)
    leave_out(HealthReason::stale);
  lose(*objection_, now);
}

void HealthMonitor::on_feedback(LidarOpinion opinion, const RegistrationFeedback& feedback, Stamp now) {
  if (is_too_slow())
    return;
  for (const auto& metric : metrics_) {
    const auto reason = metric->on_feedback(opinion, feedback);
    if (!reason || state_ == State::never_received || (state_ == State::lost && reason != HealthReason::self_check))
      continue;
    leave_out(*reason);
    lose(*reason, now);
  }
}

void HealthMonitor::set_outside_verdict(bool healthy, Stamp now) {
  outside_objects_ = !healthy;
  if (outside_objects_)
    lose(HealthReason::outside, now);
}

void HealthMonitor::lose(HealthReason reason, Stamp now) {
  if (state_ == State::healthy || (state_ == State::never_received && refusal_ && refusal_->is_worth_reporting())) {
    lost_for_ = reason;
    change(false, reason, now);
  } else if (reason == HealthReason::self_check) { // also if already lost: it may be permanent
    event_ = HealthEvent{.stamp = now, .healthy = false, .reason = reason, .verdict = verdict()};
  }
  state_ = State::lost;
  ++epoch_;
  for (const auto& metric : metrics_)
    metric->reset();
}

void HealthMonitor::change(bool healthy, HealthReason reason, Stamp now) {
  ++counters_.health_changes;
  event_ = HealthEvent{.stamp = now, .healthy = healthy, .reason = reason, .verdict = {}};
  if (!healthy && reason == HealthReason::self_check)
    event_->verdict = verdict();
}

std::optional<HealthEvent> HealthMonitor::pop_event() { return std::exchange(event_, std::nullopt); }

std::string_view HealthMonitor::verdict() const {
  for (const auto& metric : metrics_) {
    if (const std::string_view verdict = metric->verdict(); !verdict.empty())
      return verdict;
  }
  return {};
}

bool HealthMonitor::trusts_accelerometer() const {
  return std::ranges::all_of(metrics_, [](const auto& metric) { return metric->trusts_accelerometer(); });
}

std::optional<Eigen::Matrix3d> HealthMonitor::gyro_axes() const {
  for (const auto& metric : metrics_)
    if (const auto axes = metric->gyro_axes())
      return axes;
  return std::nullopt;
}

std::optional<Duration> HealthMonitor::period() const {
  constexpr std::uint64_t kEnough = 50;
  return counters_.received >= kEnough && period_s_ > 0.0 ? std::optional(from_seconds(period_s_)) : std::nullopt;
}

Duration HealthMonitor::timeout() const {
  if (period_s_ == 0.0)
    return kLongestTimeout;
  return std::clamp(from_seconds(kPeriodsOfSilence * period_s_), kShortestTimeout, kLongestTimeout);
}

/// Learns the period of the source. Steps beyond the timeout count, too, or a source that has slowed down for good
/// would be silent for ever; but a long silence counts no more than a short one, and a step back, after a clock was
/// set, is ignored.
void HealthMonitor::learn_period(Duration step) {
  if (step <= Duration{})
    return;
  const double step_s = to_seconds(step);
  if (period_s_ == 0.0)
    period_s_ = std::min(step_s, to_seconds(kLongestTimeout));
  else
    period_s_ += (std::min(step_s, 2.0 * kPeriodsOfSilence * period_s_) - period_s_) / kPeriodMemory_samples;
}

} // namespace locus
