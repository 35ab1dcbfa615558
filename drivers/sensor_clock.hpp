// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>

#include "core/base/stamp.hpp"
#include "drivers/lidar_options.hpp"

namespace locus {

/// Converts a lidar's time of hour to stamps of the host's clock. Intervals always come from the lidar's clock;
/// LidarTime selects the source of the offset:
/// - receive: the reception stamps. A packet cannot arrive before its last firing and is sometimes late, so the lower
///   envelope of (reception - end of packet) over the last second is the offset. The offset follows it at 500 ppm at
///   most (5 % in the first second), so network jitter does not reach the stamps.
/// - sensor: the time of hour itself, in the hour that puts the packet closest to its reception. Correct while the
///   host's clock is right to half an hour; the host's clock should be on UTC too, otherwise the stamps do not match
///   those of the other sensors.
/// - automatic: sensor while the lidar is synchronised, otherwise receive. It switches to sensor if the lidar's time is
///   within 20 ms of the reception estimate (otherwise the host's clock is not on UTC, and stamps must be in the host's
///   clock). Late packets do not end it unless they are late for half a minute, which no network causes.
///
/// Rejects a time that is inconsistent with the previous ones. Five rejected times in a row that are consistent with
/// each other prove a clock step: it is counted, and the clock restarts from there. Late packets prove a step only if
/// they arrive at the pace of a clock, not in a burst after network congestion. Drift too fast for the envelope (error
/// above 5 ms) also counts as a step. After a minute of silence the clock restarts, so packets that a lidar did not
/// send while it was off do not count as lost. Time of hour wraps every hour without effect. Reads no clock, allocates
/// nothing. Single owner, not thread-safe.
///
/// After a step of the host's clock, stamps stay on the time base before it (`set_by`), and a lidar on UTC is compared
/// again with the stepped clock; in mode `sensor` the offset changes, and the clock restarts from there.
class SensorClock {
 public:
  /// Stamp of one packet.
  struct Reading {
    Stamp stamp;      ///< instant of the time of hour
    Duration advance; ///< sensor time since the latest packet; < 0 for an overtaken packet
    bool continuous;  ///< false for the first packet and after a step; `advance` is then undefined
  };

  explicit SensorClock(LidarTime mode) : mode_(mode) {}

  /// Converts the time of one data packet, which is sent `until_sent` after its time of hour. Returns nothing if the
  /// time is rejected. `set_by`: see Datagram::clock_set_by. Precondition: 0 <= time_of_hour < 1 h.
  std::optional<Reading> read(Duration time_of_hour, Duration until_sent, Stamp receive, Duration set_by = {});

  /// Returns the stamp of another instant of the same clock, e.g. of the lidar's IMU. Empty before the first packet,
  /// and for times more than one second from the latest one.
  [[nodiscard]] std::optional<Stamp> stamp_of(Duration time_of_hour, Stamp receive) const;

  /// Sets whether the lidar reports that its clock is on UTC.
  void set_synchronised(bool synchronised) {
    synchronised_ = synchronised;
    knows_utc_ = knows_utc_ && synchronised;
  }

  [[nodiscard]] std::uint64_t steps() const { return steps_; }

 private:
  /// Lower envelope of the reception delay over the last one to two spans.
  struct Envelope {
    Stamp span_start;
    Duration minimum, previous_minimum;
    [[nodiscard]] Duration lowest() const { return minimum < previous_minimum ? minimum : previous_minimum; }
  };

  void anchor(Duration time_of_hour, Duration until_sent, Stamp receive);
  [[nodiscard]] Duration unwrap(Duration time_of_hour, Stamp receive) const;
  [[nodiscard]] bool follows(Duration sensor_time, Duration until_sent, Stamp receive) const;
  [[nodiscard]] Duration lateness(Duration sensor_time, Duration until_sent, Stamp receive) const;
  bool proves_step(Duration time_of_hour, Stamp receive, bool late);
  void track(Duration sensor_time, Duration until_sent, Stamp receive);
  void believe_sensor(Duration sensor_time, Stamp receive);
  [[nodiscard]] Stamp stamp(Duration sensor_time, Stamp receive) const;

  LidarTime mode_;
  bool synchronised_ = false;
  bool knows_utc_ = false; ///< automatic mode: offset_ comes from the lidar's own UTC time
  Stamp agreed_at_;        ///< latest reception that confirmed that time
  std::uint64_t steps_ = 0;
  Duration set_by_{};  ///< total step of the host's clock since the first stamp
  Stamp last_receive_; ///< reception of the latest packet, accepted or not

  bool anchored_ = false;
  Duration latest_{};    ///< latest sensor time: time of hour at the anchor, unwrapped since
  Stamp latest_receive_; ///< reception of that packet
  Duration offset_{};    ///< host's clock - sensor time
  Stamp settled_at_;
  Envelope envelope_{};

  int suspects_ = 0; ///< rejected times in a row that are consistent with each other
  Duration suspect_time_of_hour_{};
  Stamp suspect_receive_;
  Duration suspects_ahead_{}; ///< sensor time in excess of the pace of a live clock
};

} // namespace locus
