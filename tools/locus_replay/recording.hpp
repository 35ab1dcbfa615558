// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "daemon/input.hpp"
#include "drivers/lidar_input.hpp"
#include "drivers/net/datagram.hpp"
#include "drivers/other_maker.hpp"
#include "faults/fault_injection.hpp"
#include "locus_replay/motion_recordings.hpp"
#include "locus_replay/recorded_times.hpp"

namespace locus::tools {

/// Which part of a recording is played, and what is made to go wrong in it.
struct PlayOptions {
  Duration start{};                 ///< after the first datagram of the capture
  std::optional<Duration> duration; ///< nothing: to the last datagram
  std::vector<Fault> faults;        ///< fault_problem() finds nothing
  std::uint64_t seed = 1;           ///< of the faults
  std::vector<Duration> earlier{};  ///< for how long before its time each motion source is played; none: as it came
};

/// Throws Failure for a fault that none of the sensors can have.
void check_faults(const std::vector<Fault>& faults, const Config& config);

/// The datagrams that went to one UDP port.
struct PortTraffic {
  std::uint64_t datagrams = 0;
  std::map<std::size_t, std::uint64_t> by_length;           ///< of them, by their bytes
  std::array<std::uint64_t, kOtherMakers> of_other_maker{}; ///< by what they look like
  std::string_view hesai;                                   ///< of the latest one of Hesai among these: its model
  std::size_t bytes = 0;                                    ///< of the latest
  std::uint32_t source_ip = 0;                              ///< of the latest
};

/// A recording as it once came in: datagrams and motion samples in the order of their arrival, faults injected.
///
/// The capture is streamed, and so are motion samples that no fault befalls. Motion is played from one second ahead of
/// the first datagram, so that the sources are known by then, and to the last one. A datagram that a fault swallows
/// leaves Silence behind. One owner.
class Recording : public daemon::InputSource {
 public:
  /// `lidars`: to tell by port and address whose datagram a fault strikes.
  Recording(std::unique_ptr<DatagramSource> source, std::vector<MotionRecording> motion, const Config& config,
            LidarRouter lidars, const PlayOptions& options);

  daemon::Input next(Duration timeout) override;

  /// Share of the recording that is over, 0..1. Any thread.
  [[nodiscard]] double progress() const { return progress_.load(std::memory_order_relaxed); }

  [[nodiscard]] const DatagramSource& source() const { return *source_; }
  [[nodiscard]] const std::vector<Fault>& faults() const { return injected_; }
  /// When its first datagram came: what --start and the seconds of faults count from.
  [[nodiscard]] Stamp capture_start() const { return capture_start_; }
  /// From the first to the last datagram played.
  [[nodiscard]] Duration duration() const { return last_ - first_; }
  [[nodiscard]] const std::map<std::uint16_t, PortTraffic>& traffic() const { return traffic_; }
  /// That more datagrams than not are older than the one before them in the file, with what helps; nothing where they
  /// are in order, but for some that were overtaken on their way.
  [[nodiscard]] std::optional<std::string> runs_backwards() const;
  /// Returns the time by the clock of the recording computer, which may have been set in the recording.
  [[nodiscard]] Stamp wall(Stamp steady) const { return source_->wall(steady); }
  /// What is wrong with the capture and with the motion played along with it, a line for the user each.
  [[nodiscard]] std::vector<std::string> warnings() const;

 private:
  struct Pending { ///< the next input that is no motion sample
    daemon::Input input;
    Stamp arrival;
  };
  struct OwnedDatagram {
    Datagram datagram; ///< without payload
    std::vector<std::byte> payload;
  };
  struct MotionCursor {
    MotionRecording recording;
    bool has_faults; ///< injected
    Duration earlier{};
    const RecordedTimes* times = nullptr;

    [[nodiscard]] Stamp arrival() const; ///< of the next sample; Stamp::max() after the last
    [[nodiscard]] std::optional<TimeSpan> arrivals() const;
    daemon::Input take();
  };

  const Datagram* read();
  void note(const Datagram& datagram);
  void note_traffic(const Datagram& datagram);
  Pending fetch();

  std::unique_ptr<RecordedTimes> source_;
  std::vector<MotionCursor> motion_;
  LidarRouter lidars_; ///< never receives anything
  std::optional<Duration> play_for_;
  const Datagram* head_; ///< read ahead to learn when the capture begins
  Stamp capture_start_;
  Stamp begin_, end_; ///< of the part that is played
  bool capture_is_over_ = false;
  std::vector<Fault> injected_;
  std::optional<DatagramFaults> faults_;
  std::deque<OwnedDatagram> faulty_; ///< came out of the faults, not given out yet
  OwnedDatagram given_out_;
  std::optional<Pending> pending_;

  std::uint64_t read_ = 0, backwards_ = 0; ///< datagrams of the file, and those older than the one before
  Stamp latest_read_;
  bool started_ = false;
  Stamp first_, last_;
  std::map<std::uint16_t, PortTraffic> traffic_; ///< by destination port
  std::atomic<double> progress_{0.0};
};

} // namespace locus::tools
