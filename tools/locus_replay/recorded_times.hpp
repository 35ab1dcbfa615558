// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "drivers/lidar_input.hpp"
#include "drivers/lidar_options.hpp"
#include "drivers/net/datagram.hpp"

namespace locus::tools {

/// Puts right the arrival times of a recording that the lidar's own clock disproves.
///
/// - All the same, or nearly so, though the lidar's clock goes on: the lidar's clock is taken instead. It is on UTC if
///   PPS is locked and a position packet tells the date; otherwise it begins at the first arrival.
/// - A leap by more than ten seconds, forward or back, over which the lidar's clock has hardly gone on: the clock of
/// the
///   recording computer was set. The leap is taken out of the arrivals, as in SteadyTime, and wall() puts it back.
///
/// The first packets are read ahead and decoded for that, later ones only to judge a leap. Decoded packets and clouds
/// have no such clock and pass as they are. Single owner, not thread-safe.
class RecordedTimes : public DatagramSource {
 public:
  RecordedTimes(std::unique_ptr<DatagramSource> source, std::vector<LidarOptions> lidars);

  const Datagram* next() override;
  [[nodiscard]] std::uint64_t datagrams() const override { return source_->datagrams(); }
  [[nodiscard]] std::string why_none() const override { return source_->why_none(); }
  [[nodiscard]] std::vector<std::string> warnings() const override;
  [[nodiscard]] double progress() const override { return source_->progress(); }

  /// Returns the time by the clock of the recording computer as it was set at the time, but never before that at the
  /// start, so that the rows of a result stay in order.
  [[nodiscard]] Stamp wall(Stamp steady) const;
  /// Returns the opposite for a stamp after a leap forward that has been found; others stay as they are.
  [[nodiscard]] Stamp steady(Stamp wall) const;

 private:
  struct Held {
    Datagram datagram; ///< without payload
    std::vector<std::byte> payload;
  };
  /// Follows the clock of the first lidar that is heard.
  class LidarTime {
   public:
    explicit LidarTime(LidarRouter lidars) : lidars_(std::move(lidars)) {}

    /// Takes a datagram, whatever its arrival. Returns whether it is the first packet of that lidar, or goes on in
    /// time.
    bool take(Datagram datagram);
    /// Returns the time since the first packet.
    [[nodiscard]] Duration elapsed() const { return elapsed_; }
    /// Returns the UTC of the first packet, where position packets tell it.
    [[nodiscard]] std::optional<Stamp> utc() const;

   private:
    LidarRouter lidars_;
    std::optional<std::uint8_t> lidar_;
    Stamp first_, latest_;
    Duration elapsed_{};
  };
  /// Leap of the recording computer's clock.
  struct Leap {
    Stamp at; ///< first arrival after it, steady
    Stamp wall_before;
    Duration by;
  };

  void look_ahead();
  [[nodiscard]] bool arrivals_stand_still(const LidarTime& time) const;
  const Datagram* take_next();
  [[nodiscard]] std::optional<LidarTime> open_time() const;
  void follow_lidar();
  void look_for_leap();
  [[nodiscard]] bool is_reference() const;
  [[nodiscard]] std::optional<Duration> lidar_time_since_reference() const;

  std::unique_ptr<DatagramSource> source_;
  std::vector<LidarOptions> lidars_;
  bool has_looked_ahead_ = false;
  std::deque<Held> held_;
  Held given_out_;
  Datagram datagram_;
  std::optional<LidarTime> lidar_time_; ///< replaces the arrivals
  bool is_utc_ = false;
  Stamp begin_; ///< of lidar_time_

  std::optional<Held> reference_; ///< latest packet of one lidar, with its arrival as recorded
  bool has_started_ = false;
  Stamp latest_wall_, latest_; ///< arrival of the latest datagram, as recorded and steady
  int unexplained_ = 0;        ///< datagrams since a leap that none of that lidar has explained
  Duration set_by_{};
  std::vector<Leap> leaps_;
};

} // namespace locus::tools
