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
#include "daemon/service/state_saver.hpp"

namespace locus::daemon {

/// Resolves record.folder: relative to the state directory, or without one to the working directory.
std::filesystem::path record_folder(const std::filesystem::path& folder);

/// Runtime of the service under one configuration: sockets, DDS, live threads, publisher. A reload replaces it.
class Session {
 public:
  /// Opens all files and sockets and starts all threads. Fails with one line for the user.
  /// `incidents`, null without a folder for them, and `resets`, the count that Figures::Live has, must outlive the
  /// session.
  static Expected<std::unique_ptr<Session>, std::string> start(const Config& config, std::span<const int> inherited,
                                                               std::optional<SavedState> state, Incidents* incidents,
                                                               std::atomic<std::uint64_t>& resets, Log& log);
  ~Session();
  Session(const Session&) = delete;
  Session& operator=(const Session&) = delete;

  [[nodiscard]] const Config& config() const { return config_; }
  [[nodiscard]] const LiveInput& input() const { return input_; }
  [[nodiscard]] RosLink& link() { return link_; }
  /// Returns the current figures; the session must outlive them.
  [[nodiscard]] Figures figures() const;

  /// Heartbeats of the threads; an unchanged number marks a thread that has not run since the last call.
  struct Progress {
    LivePipeline::Progress live;
    std::uint64_t publisher, dds;
  };
  [[nodiscard]] Progress progress() const;

  /// Resets the odometry to a pose, or level at the origin, with an empty map. Returns the reason if a calibration can
  /// no longer be read: the odometry then continues unchanged.
  std::optional<std::string> reset(std::optional<Pose> T_odom_base);

  /// Stops the live threads and returns the state for another session to resume from; without an estimate, the state
  /// that this session started with, if any.
  std::optional<SavedState> stop();

  /// Requests the surfaces of the map, available after the next sweep. Supersedes an earlier request.
  void request_map() { map_requests_.fetch_add(1, std::memory_order_relaxed); }
  [[nodiscard]] const std::vector<SurfacePoint>* poll_map();

  /// A processed sweep, for a viewer.
  struct ViewedSweep {
    Stamp run_began;            ///< wall clock; another value marks another odom frame or an empty map
    std::uint64_t sequence = 0; ///< Sweep::sequence
    Stamp stamp;                ///< wall clock
    Pose T_odom_base;
    std::vector<SurfacePoint> points; ///< Odometry::scan()
  };
  /// Has the odometry thread hand over each sweep of the next second, and returns the newest, or nullptr before the
  /// first one; valid until the next call.
  [[nodiscard]] const ViewedSweep* view();

  void set_flat_ground(FlatGround mode);
  [[nodiscard]] FlatGround flat_ground() const { return flat_ground_.load(std::memory_order_relaxed); }

 private:
  Session(const Config& config, LidarRouter lidars, std::vector<UdpSocket> sockets, std::optional<SavedState> state,
          Incidents* incidents, std::atomic<std::uint64_t>& resets, Log& log);
  void begin(LidarRouter lidars);
  InputSource& begin_recording();
  InputSource& record_to(const std::filesystem::path& folder, const RecordingBounds& bounds);
  /// Tells whether incidents can be stored, that is, whether their input is being recorded.
  [[nodiscard]] bool stores_incidents() const;
  void write_to_disk(bool last_round);
  void end();
  void hand_to_viewer(const Sweep& sweep, const Odometry& odometry, const OdometryEstimate& estimate);
  void after_estimate(const Sweep& sweep, const Odometry& odometry, const OdometryEstimate& estimate);
  void receive(const RosInput& input);
  void receive(std::uint8_t lidar, Stamp arrival, std::string_view type, const SerialisedSample& cloud);
  void apply(FlatGroundMessage message);
  void run_publisher();
  void publish(const ProcessedSweep& done);
  [[nodiscard]] OdometryEstimate in_wall_time(const OdometryEstimate& estimate) const;
  void log_clock_steps();
  void announce(const OdometryEstimate& estimate);
  void log_state(TrackingState state);
  void log_health(const HealthEvent& event);

  Config config_;
  Log& log_;
  MachineTime started_;
  struct Collected { ///< figures collected by the publisher
    SweepStatistics sweeps{600};
    IngestReport ingest;
    std::uint64_t unpublished = 0;
  };
  Collected collected_;
  mutable std::mutex collected_mutex_; ///< guards collected_
  LiveInput input_;
  std::atomic<FlatGround> flat_ground_;
  Duration flat_ground_changed_{};     ///< owned by the link's thread
  Incidents* incidents_;               ///< null: no folder for incidents
  std::atomic<std::uint64_t>& resets_; ///< written by the publisher
  bool records_to_memory_ = false;     ///< the recording is in memory, for incidents only
  bool old_ring_removed_ = false;      ///< remains of earlier sessions or processes are removed; disk thread
  std::unique_ptr<Recorder> recorder_; ///< one run; null without recording
  std::optional<RecordingInput> recording_input_;
  std::unique_ptr<LivePipeline> pipeline_;
  std::mutex pipeline_mutex_;  ///< guards pipeline_ between its owner and the link's thread
  bool has_saved_map_ = false; ///< started with the map of an earlier run
  bool announced_ = false;
  std::atomic<bool> scheduling_logged_ = false;
  std::optional<Diagnostic> announcement_; ///< not yet accepted by DDS
  struct Map {
    std::uint64_t request = 0;
    std::vector<SurfacePoint> points;
  };
  std::atomic<std::uint64_t> map_requests_{0}; ///< number of the last request
  std::uint64_t map_delivered_ = 0;            ///< last answered request; owned by the odometry thread
  LatestSlot<Map> map_;
  Stamp run_began_;                        ///< written while no odometry thread runs
  std::atomic<Duration> viewed_until_{{}}; ///< CLOCK_MONOTONIC
  LatestSlot<ViewedSweep> viewed_;
  const ViewedSweep* last_viewed_ = nullptr; ///< last value of viewed_; owned by the caller of view()
  RosLink link_;
  CloudPublisher clouds_;
  std::optional<SavedState> start_; ///< initial state, until the first estimate
  EarlierCalibration calibration_;  ///< calibration learned in the previous run or before a reset
  StateSaver state_saver_;
  std::optional<TrackingState> logged_state_;
  Duration logged_clock_steps_{};
  std::atomic<std::uint64_t> publisher_progress_{0};
  std::atomic<bool> stopping_{false};
  std::thread publisher_;
  std::optional<Worker> disk_; ///< writes states and recordings
};

} // namespace locus::daemon
