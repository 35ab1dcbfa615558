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

#include "drivers/lidar_options.hpp"
#include "drivers/lidar_router.hpp"
#include "drivers/net/datagram.hpp"

namespace locus::tools {

/// Replaces the arrival times of a recording by the lidar's own clock if they are all (nearly) the same although that
/// clock advances. The time is UTC if PPS is locked and a position packet contains the date; otherwise it starts at the
/// first arrival.
///
/// Reads ahead and decodes the first packets to decide. Decoded packets and clouds have no such clock and pass
/// unchanged. Single owner, not thread-safe.
class RecordedTimes : public DatagramSource {
 public:
  RecordedTimes(std::unique_ptr<DatagramSource> source, std::vector<LidarOptions> lidars);

  const Datagram* next() override;
  [[nodiscard]] std::uint64_t datagrams() const override { return source_->datagrams(); }
  [[nodiscard]] std::string why_none() const override { return source_->why_none(); }
  [[nodiscard]] std::vector<std::string> warnings() const override;
  [[nodiscard]] double progress() const override { return source_->progress(); }

 private:
  struct Stored {
    Datagram datagram; ///< without payload
    std::vector<std::byte> payload;
  };
  /// Clock of the first lidar that sends packets.
  class LidarClock {
   public:
    explicit LidarClock(LidarRouter lidars) : lidars_(std::move(lidars)) {}

    /// Reads the time of a datagram; ignores its arrival time.
    void accept(Datagram datagram);
    /// Returns the time since the first packet was sent.
    [[nodiscard]] Duration elapsed() const { return elapsed_; }
    /// Returns the UTC time at which the first packet was sent if position packets contain it.
    [[nodiscard]] std::optional<Stamp> utc() const;

   private:
    LidarRouter lidars_;
    std::optional<std::uint8_t> lidar_;
    Stamp first_, latest_; ///< sent then
    Duration elapsed_{};
  };

  void look_ahead();
  [[nodiscard]] bool arrivals_stand_still(const LidarClock& clock) const;
  const Datagram* next_unchanged();
  [[nodiscard]] std::optional<LidarClock> open_clock() const;

  std::unique_ptr<DatagramSource> source_;
  std::vector<LidarOptions> lidars_;
  bool has_looked_ahead_ = false;
  std::deque<Stored> stored_; ///< read ahead
  Stored returned_;
  Datagram datagram_;
  std::optional<LidarClock> lidar_clock_; ///< replaces the arrival times
  bool is_utc_ = false;
  Stamp begin_; ///< time of the first packet by lidar_clock_
};

} // namespace locus::tools
