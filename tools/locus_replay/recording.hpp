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
#include "drivers/lidar_router.hpp"
#include "drivers/net/datagram.hpp"
#include "drivers/other_maker.hpp"
#include "faults/fault_injection.hpp"
#include "locus_replay/clock_follower.hpp"
#include "locus_replay/motion_recordings.hpp"
#include "locus_replay/steady_arrivals.hpp"

namespace locus::tools {

/// Part of a recording to play, and the faults to inject.
struct PlayOptions {
  Duration start{};                 ///< after the first datagram of the capture
  std::optional<Duration> duration; ///< nothing: to the last datagram
  std::vector<Fault> faults;        ///< fault_problem() returns nothing for them
  std::uint64_t seed = 1;           ///< of the faults
  std::vector<Duration> earlier{};  ///< by how much each motion source is advanced; none: as recorded
};

/// Throws Failure for a fault that none of the sensors can have.
void check_faults(const std::vector<Fault>& faults, const Config& config);

/// Datagrams to one UDP port.
struct PortTraffic {
  std::uint64_t datagrams = 0;
  std::map<std::size_t, std::uint64_t> by_length;           ///< number of datagrams, by size in bytes
  std::array<std::uint64_t, kOtherMakers> of_other_maker{}; ///< number of datagrams, by apparent maker
  std::uint64_t of_ouster_imu = 0;                          ///< number of datagrams of an Ouster's inertial unit
  std::string_view hesai;                                   ///< model of the latest Hesai datagram among these
  std::size_t bytes = 0;                                    ///< of the latest
  std::uint32_t source_ip = 0;                              ///< of the latest
};

/// Recording in its original timing: datagrams and motion samples in order of arrival, with faults injected.
///
/// All times are steady: steps of the recording computer's clock are removed (SteadyArrivals, ClockFollower).
///
/// Streams the capture, and motion samples without faults. Motion is played from one second before the first datagram,
/// so that the sources are known by then, up to the last one. A datagram dropped by a fault yields Silence. One owner.
class Recording : public daemon::InputSource {
 public:
  /// Opens the recording. `lidars`: identify the lidar of a datagram by port and address.
  Recording(std::unique_ptr<DatagramSource> source, std::vector<MotionRecording> motion, const Config& config,
            LidarRouter lidars, const PlayOptions& options);

  daemon::Input next(Duration timeout) override;

  /// Returns the share of the recording that is over, 0..1. Any thread.
  [[nodiscard]] double progress() const { return progress_.load(std::memory_order_relaxed); }

  [[nodiscard]] const DatagramSource& source() const { return *source_; }
  /// Returns the steps of the recording computer's clock found so far.
  [[nodiscard]] const std::vector<ClockStep>& clock_steps() const { return source_->steps(); }
  [[nodiscard]] const std::vector<Fault>& faults() const { return injected_; }
  /// Returns the arrival of the first datagram: the origin of --start and of the seconds of faults.
  [[nodiscard]] Stamp capture_start() const { return capture_start_; }
  /// Returns the time from the first to the last datagram played.
  [[nodiscard]] Duration duration() const { return last_ - first_; }
  [[nodiscard]] const std::map<std::uint16_t, PortTraffic>& traffic() const { return traffic_; }
  /// Returns an error, with a remedy, if most datagrams are older than the preceding one in the file; nothing if they
  /// are in order except for some reordering by the network.
  [[nodiscard]] std::optional<std::string> runs_backwards() const;
  /// Returns the file of a motion source's samples; nullptr if it has none.
  [[nodiscard]] const std::filesystem::path* file_of(SourceId source) const;
  /// Returns problems of the capture and its motion, a line for the user each.
  [[nodiscard]] std::vector<std::string> warnings() const;

 private:
  struct Pending { ///< next input other than a motion sample
    daemon::Input input;
    Stamp arrival;
  };
  struct OwnedDatagram {
    Datagram datagram; ///< without payload
    std::vector<std::byte> payload;
  };
  struct MotionCursor {
    MotionRecording recording;
    bool has_faults; ///< injected by this
    Duration earlier{};
    ClockFollower clock{};
    const std::vector<ClockStep>* steps;
    bool is_used = false; ///< a sample has been returned

    [[nodiscard]] Stamp arrival() const; ///< arrival of the next sample; Stamp::max() after the last
    [[nodiscard]] std::optional<TimeSpan> arrivals() const;
    daemon::Input pop();
  };

  const Datagram* read();
  void note(const Datagram& datagram);
  void note_traffic(const Datagram& datagram);
  void skip_motion();
  Pending fetch();

  LidarRouter lidars_; ///< for look-ups only
  std::unique_ptr<SteadyArrivals> source_;
  std::vector<MotionCursor> motion_;
  std::optional<Duration> play_for_;
  const Datagram* head_; ///< read ahead, to find the start of the capture
  Stamp capture_start_;
  Stamp begin_, end_; ///< of the part played
  bool has_begun_ = false;
  bool capture_is_over_ = false;
  std::vector<Fault> injected_;
  std::optional<DatagramFaults> faults_;
  std::deque<OwnedDatagram> faulty_; ///< emitted by the faults, not returned yet
  OwnedDatagram given_out_;
  std::optional<Pending> pending_;

  std::uint64_t read_ = 0, backwards_ = 0; ///< datagrams of the file, and those older than the preceding one
  Stamp latest_read_;
  bool started_ = false;
  Stamp first_, last_;
  std::map<std::uint16_t, PortTraffic> traffic_; ///< by destination port
  std::atomic<double> progress_{0.0};
};

} // namespace locus::tools
