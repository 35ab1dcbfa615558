// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>

#include "core/base/stamp.hpp"
#include "drivers/lidar_options.hpp"

namespace locus {

/// Turns a lidar's time of hour into stamps of the host's clock. The lidar's clock always is the ruler; LidarTime says
/// what fixes its zero:
/// - receive: the stamps of reception. A packet cannot arrive before its last firing and is sometimes late, so the
///   lower envelope of (reception - end of packet) over the last second is the offset. It is followed at 500 ppm at
///   most (5 % in the first second), so jitter of the network does not reach the stamps.
/// - sensor: the time of hour itself; of all hours the one that puts the packet closest to its reception. Right as
///   long as the host's clock is right to half an hour; the host's clock should be on UTC too, or the lidar's stamps
///   are not those of the other sensors.
/// - automatic: sensor while the lidar is synchronised, otherwise receive. It begins where the lidar's time is within
///   20 ms of what reception says (else the host's clock is not on UTC, and stamps are promised to be the host's) and
///   does not end because packets come late, unless they do so for half a minute: no network does.
///
/// A time that does not follow from the ones before is refused. When five in a row follow from each other instead, the
/// clock was set: a step, counted, and time goes on from there. Packets that come late must come at the pace of a clock
/// for that, not all at once from where a network held them up. A drift that the envelope cannot be followed at (error
/// beyond 5 ms) is a step too. After a minute of silence it begins anew: what a lidar that was off did not send is not
/// lost. Time of hour wraps every hour, unnoticed. Reads no clock, allocates nothing. One owner.
///
/// Where the host's clock has been set, stamps stay in the time before (`set_by`), and a lidar on UTC is compared anew
/// with that clock as it is by now; with `sensor` that is another zero, and time goes on from there.
class SensorClock {
 public:
  /// One packet's place in time.
  struct Reading {
    Stamp stamp;      ///< of the instant that the time of hour names
    Duration advance; ///< of the sensor's clock since the latest packet before; < 0 for a packet that comes late
    bool continuous;  ///< false for the first packet and the one after a step: `advance` means nothing
  };

  explicit SensorClock(LidarTime mode) : mode_(mode) {}

  /// Takes the stamps of one data packet, which is sent `until_sent` after the instant that its time of hour names;
  /// nothing if its time is refused. `set_by`: as Datagram::clock_set_by has it. Precondition: 0 <= time_of_hour < 1 h.
  std::optional<Reading> read(Duration time_of_hour, Duration until_sent, Stamp receive, Duration set_by = {});

  /// The stamp of another instant of the same clock, e.g. that of a lidar's inertial unit. Nothing before the first
  /// packet, and for what is not of the second around the latest one.
  [[nodiscard]] std::optional<Stamp> stamp_of(Duration time_of_hour, Stamp receive) const;

  /// Whether the lidar's clock is on UTC, as its packets say.
  void set_synchronised(bool synchronised) {
    synchronised_ = synchronised;
    knows_utc_ = knows_utc_ && synchronised;
  }

  [[nodiscard]] std::uint64_t steps() const { return steps_; }

 private:
  /// Lower envelope of the delay of reception, over one to two of its spans.
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
  bool knows_utc_ = false; ///< automatic: offset_ is that of the lidar's own time
  Stamp agreed_at_;        ///< when reception last said the same
  std::uint64_t steps_ = 0;
  Duration set_by_{};  ///< of the host's clock, since the time of the stamps began
  Stamp last_receive_; ///< of any packet

  bool anchored_ = false;
  Duration latest_{};    ///< latest sensor time: time of hour at the anchor, counted on from there
  Stamp latest_receive_; ///< of that packet
  Duration offset_{};    ///< host's clock = sensor time + offset
  Stamp settled_at_;
  Envelope envelope_{};

  int suspects_ = 0; ///< refused times that follow from each other
  Duration suspect_time_of_hour_{};
  Stamp suspect_receive_;
  Duration suspects_ahead_{}; ///< of the pace that is possible
};

} // namespace locus
