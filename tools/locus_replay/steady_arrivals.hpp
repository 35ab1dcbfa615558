// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "drivers/clouds/cloud_view.hpp"
#include "drivers/lidar_router.hpp"
#include "drivers/net/datagram.hpp"
#include "locus_replay/clock_follower.hpp"

namespace locus::tools {

/// Removes the steps of the recording computer's clock from the arrival times of a recording.
///
/// The clock was set if packets that follow each other by the lidar's own clock do not by their arrival, and the later
/// ones arrive at the pace of that clock: a network delays packets, but then they come in a burst, and none comes
/// before the one that was sent before it. Reads ahead by half a second where arrivals jump.
///
/// Clouds have no such clock, but an interval, and are in order: the clock was set if one arrives before its
/// predecessor, or more than a day after it. The stamps in their headers continue, too, if they follow the same clock.
/// Decoded packets pass unchanged. Single owner, not thread-safe.
class SteadyArrivals : public DatagramSource {
 public:
  /// `lidars` identify the lidar of a datagram.
  SteadyArrivals(std::unique_ptr<DatagramSource> source, const LidarRouter& lidars)
      : source_(std::move(source)), lidars_(lidars) {}

  const Datagram* next() override;
  [[nodiscard]] std::uint64_t datagrams() const override { return source_->datagrams() - stored_.size(); }
  [[nodiscard]] std::string why_none() const override { return source_->why_none(); }
  [[nodiscard]] std::vector<std::string> warnings() const override;
  [[nodiscard]] double progress() const override { return source_->progress(); }

  /// Steps found so far.
  [[nodiscard]] const std::vector<ClockStep>& steps() const { return steps_; }

 private:
  struct Stored {
    Datagram datagram; ///< without payload
    std::vector<std::byte> payload;
  };
  /// Clock of the packets from one address to one port.
  struct Sender {
    std::uint64_t key;
    Duration clock{};   ///< of the latest packet, modulo one hour
    Stamp arrival{};    ///< of that packet, steady
    Duration elapsed{}; ///< by the lidar's clock, since an arbitrary packet
    Stamp span_start{};
    Duration lowest{}, previous_lowest{}; ///< of the lateness of packets in this span and in the one before

    [[nodiscard]] Duration lateness(Stamp of_arrival, Duration advance) const {
      return of_arrival.time_since_epoch() - elapsed - advance;
    }
    [[nodiscard]] Duration least() const { return lowest < previous_lowest ? lowest : previous_lowest; }
    void restart(Duration at_clock, Stamp at_arrival);
    void follow(Duration at_clock, Stamp at_arrival, Duration advance);
  };
  /// Clouds of one lidar.
  struct Clouds {
    Stamp arrival{};     ///< of the latest, steady
    Stamp stamp{};       ///< in its header
    Duration interval{}; ///< usual, between arrivals; zero until known
    ClockFollower headers{Stamp::max()};
  };
  /// Time of a data packet by the clock of its sender.
  struct Reading {
    std::uint64_t sender; ///< key
    Duration clock;
  };

  bool store_next();
  [[nodiscard]] Datagram stored(std::size_t i) const;
  [[nodiscard]] std::optional<Reading> read(const Datagram& datagram) const;
  [[nodiscard]] Sender* find(std::uint64_t sender);
  void follow(const Datagram& datagram);
  [[nodiscard]] bool jumps(const Datagram& datagram) const;
  void look_for_step();
  void add_step(ClockStep step);
  void pass_cloud();
  [[nodiscard]] std::optional<Duration> step_from(std::size_t first, const Sender& sender);

  std::unique_ptr<DatagramSource> source_;
  const LidarRouter& lidars_;
  std::deque<Stored> stored_; ///< read ahead
  Stored returned_;
  Datagram datagram_;
  CloudView cloud_;             ///< of datagram_
  std::optional<Stamp> latest_; ///< arrival of the latest datagram, as recorded
  std::vector<Sender> senders_;
  std::map<std::uint8_t, Clouds> clouds_; ///< by lidar
  Duration set_by_{};                     ///< sum of all steps
  std::vector<ClockStep> steps_;
};

} // namespace locus::tools
