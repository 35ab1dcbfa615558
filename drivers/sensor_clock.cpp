// SPDX-License-Identifier: Apache-2.0
#include "drivers/sensor_clock.hpp"

#include <algorithm>
#include <utility>

namespace locus {

namespace {

using std::chrono::milliseconds;

constexpr Duration kHour = std::chrono::hours{1};
constexpr Duration kReorderWindow = milliseconds{100}; ///< greatest lateness of an overtaken packet
constexpr Duration kMaxEarly = milliseconds{20};       ///< ahead of the envelope
constexpr Duration kMaxLate = std::chrono::seconds{1}; ///< behind the envelope; no network delays packets for longer
constexpr int kMaxReplaySpeed = 10;                    ///< sensor time per reception time, mode `sensor` only
constexpr int kMaxLiveSpeed = 2;                       ///< same, for packets that no network delayed
constexpr int kProofOfStep = 5;
constexpr Duration kSilence = std::chrono::minutes{1}; ///< shortest silence of a lidar that was off

constexpr Duration kEnvelopeSpan = milliseconds{500};
constexpr Duration kSettling = std::chrono::seconds{1};
constexpr double kSettlingSlew = 0.05;
constexpr double kMaxDrift = 500e-6;
constexpr Duration kMaxOffsetError = milliseconds{5};
constexpr Duration kMaxUtcError = milliseconds{20};
constexpr Duration kLongestDelay = std::chrono::seconds{30}; ///< longest delay of all packets of a lidar on UTC

/// Returns `time` plus the number of whole hours that brings it closest to `target`.
Duration nearest_hour(Duration time, Duration target) {
  const Duration half = kHour / 2;
  Duration beyond = (target - time + half) % kHour;
  if (beyond < Duration{})
    beyond += kHour;
  return target + half - beyond;
}

} // namespace

std::optional<SensorClock::Reading> SensorClock::read(Duration time_of_hour, Duration until_sent, Stamp receive,
                                                      Duration set_by) {
  if (std::exchange(set_by_, set_by) != set_by) {
    knows_utc_ = false;
    anchored_ = anchored_ && mode_ != LidarTime::sensor;
  }
  if (receive - std::exchange(last_receive_, receive) > kSilence)
    anchored_ = false;
  const Duration sensor_time = anchored_ ? unwrap(time_of_hour, receive) : time_of_hour;
  if (!anchored_ || !follows(sensor_time, until_sent, receive)) {
    const bool late = mode_ != LidarTime::sensor && lateness(sensor_time, until_sent, receive) > kMaxLate;
    if (anchored_ && !proves_step(time_of_hour, receive, late))
      return std::nullopt;
    steps_ += anchored_ ? 1 : 0;
    anchor(time_of_hour, until_sent, receive);
    believe_sensor(time_of_hour, receive);
    return Reading{stamp(time_of_hour, receive), Duration{}, false};
  }
  suspects_ = 0;
  const Duration advance = sensor_time - latest_;
  if (advance > Duration{}) {
    if (mode_ != LidarTime::sensor)
      track(sensor_time, until_sent, receive);
    believe_sensor(sensor_time, receive);
    latest_ = sensor_time;
    latest_receive_ = receive;
  }
  return Reading{stamp(sensor_time, receive), advance, true};
}

void SensorClock::anchor(Duration time_of_hour, Duration until_sent, Stamp receive) {
  anchored_ = true;
  knows_utc_ = false;
  suspects_ = 0;
  latest_ = time_of_hour;
  latest_receive_ = receive;
  offset_ = receive.time_since_epoch() - until_sent - time_of_hour;
  settled_at_ = receive + kSettling;
  envelope_ = {receive, offset_, offset_};
}

Duration SensorClock::unwrap(Duration time_of_hour, Stamp receive) const {
  return nearest_hour(time_of_hour, latest_ + (receive - latest_receive_));
}

bool SensorClock::follows(Duration sensor_time, Duration until_sent, Stamp receive) const {
  if (sensor_time <= latest_)
    return latest_ - sensor_time <= kReorderWindow;
  const Duration advance = sensor_time - latest_;
  if (mode_ == LidarTime::sensor)
    return advance <= kReorderWindow || advance / kMaxReplaySpeed <= receive - latest_receive_;
  const Duration late_by = lateness(sensor_time, until_sent, receive);
  return late_by >= -kMaxEarly && late_by <= kMaxLate;
}

Duration SensorClock::lateness(Duration sensor_time, Duration until_sent, Stamp receive) const {
  return receive.time_since_epoch() - until_sent - offset_ - sensor_time;
}

/// Returns true if the rejected times, including this one, have been consistent with each other often enough. Late
/// packets sent in a burst after congestion are consistent too, but faster than a clock runs.
bool SensorClock::proves_step(Duration time_of_hour, Stamp receive, bool late) {
  const Duration advance = nearest_hour(time_of_hour - suspect_time_of_hour_, Duration{});
  const bool continues = suspects_ > 0 && advance > Duration{} && advance <= kReorderWindow;
  const Duration passed = std::clamp(receive - suspect_receive_, Duration{}, kReorderWindow);
  const Duration ahead = suspects_ahead_ + advance - kMaxLiveSpeed * passed;
  suspects_ = continues ? std::min(suspects_ + 1, kProofOfStep) : 1;
  suspects_ahead_ = continues ? std::clamp(ahead, Duration{}, kReorderWindow) : Duration{};
  suspect_time_of_hour_ = time_of_hour;
  suspect_receive_ = receive;
  return suspects_ == kProofOfStep && !(late && suspects_ahead_ > Duration{});
}

/// Moves the offset towards the envelope, unless it comes from UTC. Precondition: sensor_time > latest_.
void SensorClock::track(Duration sensor_time, Duration until_sent, Stamp receive) {
  const Duration delay = receive.time_since_epoch() - until_sent - sensor_time;
  envelope_.minimum = std::min(envelope_.minimum, delay);
  const bool settled = receive >= settled_at_;
  if (receive - envelope_.span_start >= kEnvelopeSpan) {
    const Duration error = envelope_.lowest() - offset_;
    if (std::chrono::abs(error) <= kMaxUtcError)
      agreed_at_ = receive;
    knows_utc_ = knows_utc_ && receive - agreed_at_ <= kLongestDelay;
    if (settled && !knows_utc_ && std::chrono::abs(error) > kMaxOffsetError) {
      ++steps_;
      offset_ += error;
    }
    envelope_ = {receive, delay, envelope_.minimum};
  }
  if (knows_utc_)
    return;
  const Duration most = from_seconds((settled ? kMaxDrift : kSettlingSlew) * to_seconds(sensor_time - latest_));
  offset_ += std::clamp(envelope_.lowest() - offset_, -most, most);
}

/// Switches to an offset of whole hours if the lidar's and the host's clock are both on UTC.
void SensorClock::believe_sensor(Duration sensor_time, Stamp receive) {
  if (mode_ != LidarTime::automatic || !synchronised_ || knows_utc_)
    return;
  const Duration by_reception = sensor_time + offset_;
  const Duration by_sensor = nearest_hour(sensor_time, by_reception + set_by_) - set_by_;
  if (std::chrono::abs(by_sensor - by_reception) > kMaxUtcError)
    return;
  knows_utc_ = true;
  agreed_at_ = receive;
  offset_ = by_sensor - sensor_time;
}

std::optional<Stamp> SensorClock::stamp_of(Duration time_of_hour, Stamp receive) const {
  constexpr Duration kFarthest = std::chrono::seconds{1};
  const Duration sensor_time = anchored_ ? nearest_hour(time_of_hour, latest_) : Duration{};
  if (!anchored_ || std::chrono::abs(sensor_time - latest_) > kFarthest)
    return std::nullopt;
  return stamp(sensor_time, receive);
}

Stamp SensorClock::stamp(Duration sensor_time, Stamp receive) const {
  if (mode_ != LidarTime::sensor)
    return Stamp{sensor_time + offset_};
  return Stamp{nearest_hour(sensor_time, receive.time_since_epoch() + set_by_) - set_by_};
}

} // namespace locus
