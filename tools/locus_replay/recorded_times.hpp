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

/// Replaces the arrival times of a recording by the lidar's own clock where they are all the same, or nearly so, though
/// that clock goes on. It is on UTC if PPS is locked and a position packet has the date; otherwise it begins at the
/// first arrival.
///
/// Reads the first packets ahead and decodes them for that. Decoded packets and clouds have no such clock and pass as
/// they are. Single owner, not thread-safe.
class RecordedTimes : public DatagramSource {
 public:
  RecordedTimes(std::unique_ptr<DatagramSource> source, std::vector<LidarOptions> lidars);

  const Datagram* next() override;
  [[nodiscard]] std::uint64_t datagrams() const override { return source_->datagrams(); }
  [[nodiscard]] std::string why_none() const override { return source_->why_none(); }
  [[nodiscard]] std::vector<std::string> warnings() const override;
  [[nodiscard]] double progress() const override { return source_->progress(); }

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

  void look_ahead();
  [[nodiscard]] bool arrivals_stand_still(const LidarTime& time) const;
  const Datagram* take_next();
  [[nodiscard]] std::optional<LidarTime> open_time() const;
  void follow_lidar();

  std::unique_ptr<DatagramSource> source_;
  std::vector<LidarOptions> lidars_;
  bool has_looked_ahead_ = false;
  std::deque<Held> held_;
  Held given_out_;
  Datagram datagram_;
  std::optional<LidarTime> lidar_time_; ///< replaces the arrivals
  bool is_utc_ = false;
  Stamp begin_; ///< of lidar_time_
};

} // namespace locus::tools
