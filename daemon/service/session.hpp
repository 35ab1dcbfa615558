// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <thread>

#include "config/config.hpp"
#include "core/base/expected.hpp"
#include "daemon/dds/ros_link.hpp"
#include "daemon/figures.hpp"
#include "daemon/incidents.hpp"
#include "daemon/input.hpp"
#include "daemon/live_pipeline.hpp"
#include "daemon/recorder.hpp"
#include "daemon/service/cloud_publisher.hpp"
#include "daemon/service/log.hpp"
#include "daemon/service/run_mark.hpp"
#include "daemon/service/saved_state.hpp"

namespace locus::daemon {

/// Where record.folder lies: a relative one in the state directory, or without one where the service was started.
std::filesystem::path record_folder(const std::filesystem::path& folder);

/// The service as one configuration makes it: sockets, DDS, the live threads, the publisher. A reload ends one and
/// begins another.
class Session {
 public:
  /// Opens what there is and starts all threads. Fails with one line for the user.
  /// Incidents, where there is a folder to keep them in, must outlive it.
  static Expected<std::unique_ptr<Session>, std::string> start(const Config& config, std::span<const int> inherited,
                                                               std::optional<SavedState> state, Incidents* incidents,
                                                               Log& log);
  ~Session();
  Session(const Session&) = delete;
  Session& operator=(const Session&) = delete;

  [[nodiscard]] const Config& config() const { return config_; }
  [[nodiscard]] const LiveInput& input() const { return input_; }
  [[nodiscard]] RosLink& link() { return link_; }
  /// As they are now; the session must outlive them.
  [[nodiscard]] Figures figures() const;

  /// A thread has done nothing since the last call if its number is the same.
  struct Progress {
    LivePipeline::Progress live;
    std::uint64_t publisher, dds;
  };
  [[nodiscard]] Progress progress() const;

  /// Begins anew, at a pose or level at the origin, with an empty map. Says why not, where a calibration cannot be read
  /// any more: all goes on as it was then.
  std::optional<std::string> reset(std::optional<Pose> T_odom_base);

  /// Ends the live threads for good, and tells what another session needs to go on: where the robot is, or without an
  /// estimate what this one began with, if anything.
  std::optional<SavedState> stop();

  /// Asks for the surfaces of the map, which come with the next sweep. An earlier request is forgotten.
  void request_map() { map_wanted_.fetch_add(1, std::memory_order_relaxed); }
  [[nodiscard]] const std::vector<SurfacePoint>* take_map();

  void set_flat_ground(FlatGround mode);
  [[nodiscard]] FlatGround flat_ground() const { return flat_ground_.load(std::memory_order_relaxed); }

 private:
  Session(const Config& config, LidarRouter lidars, std::vector<UdpSocket> sockets, std::optional<SavedState> state,
          Incidents* incidents, Log& log);
  void begin(LidarRouter lidars);
  InputSource& begin_recording();
  InputSource& record_to(const std::filesystem::path& folder, const RecordingBounds& bounds);
  /// Those to come: the input is held that they need.
  [[nodiscard]] bool keeps_incidents() const;
  void write_to_disk(bool last_round);
  void end();
  void after(const Sweep& sweep, const Odometry& odometry, const OdometryEstimate& estimate);
  void receive(const RosInput& input);
  void receive(std::uint8_t lidar, Stamp arrival, const SerialisedSample& cloud);
  void take(FlatGroundWord word);
  void publish();
  void publish(const ProcessedSweep& done);
  [[nodiscard]] OdometryEstimate on_the_wall(const OdometryEstimate& estimate) const;
  void tell_of_clock();
  void announce(const OdometryEstimate& estimate);
  void tell(TrackingState state);
  void tell(const HealthEvent& event);

  Config config_;
  Log& log_;
  MachineTime started_;
  struct Told { ///< what the publisher has heard
    SweepTally sweeps{600};
    IngestReport ingest;
    std::uint64_t unpublished = 0;
  };
  Told told_;
  mutable std::mutex told_mutex_; ///< of the publisher and those who ask for figures
  LiveInput input_;
  std::atomic<FlatGround> flat_ground_;
  Duration flat_ground_changed_{};     ///< of the thread of the link
  Incidents* incidents_;               ///< null: there is no folder for any
  bool holds_ring_ = false;            ///< the recording is that for incidents alone
  bool ring_is_looked_at_ = false;     ///< what an earlier session or process has left of it; of the thread of the disk
  std::unique_ptr<Recorder> recorder_; ///< of one run, where there is to be any
  std::optional<RecordingInput> recording_input_;
  std::unique_ptr<LivePipeline> pipeline_;
  std::mutex pipeline_mutex_; ///< of those who change pipeline_ and the thread of the link
  bool has_past_ = false;     ///< a map that another run has left
  bool announced_ = false;
  std::atomic<bool> scheduling_told_ = false;
  std::optional<Diagnostic> announcement_; ///< that DDS has not taken yet
  struct Map {
    std::uint64_t request = 0;
    std::vector<SurfacePoint> points;
  };
  std::atomic<std::uint64_t> map_wanted_{0}; ///< number of the last request
  std::uint64_t map_answered_ = 0;           ///< of the odometry thread
  LatestSlot<Map> map_;
  RosLink link_;
  CloudPublisher clouds_;
  std::optional<SavedState> start_; ///< what it began with, until the first estimate
  Recalled recalled_;               ///< of the run before, or of the time before a reset
  StateKeeper state_;
  std::optional<TrackingState> told_state_;
  Duration told_clock_set_by_{};
  std::atomic<std::uint64_t> publisher_progress_{0};
  std::atomic<bool> stopping_{false};
  std::thread publisher_;
  std::optional<Worker> disk_; ///< writes states and recordings
};

} // namespace locus::daemon
