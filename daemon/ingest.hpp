// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <functional>
#include <memory>
#include <optional>
#include <vector>

#include "config/config.hpp"
#include "core/ingest/sweep_builder.hpp"
#include "daemon/input.hpp"
#include "daemon/machine_time.hpp"
#include "drivers/clouds/cloud_decoder.hpp"
#include "drivers/lidar_router.hpp"

namespace locus::daemon {

/// Builds sweeps from the inputs: decodes packets to returns, adds motion samples to tracks, combines both.
///
/// The daemon's ingest thread and single-threaded replay make the same calls. The arrival of an input advances the time
/// before the input is processed, so an open window closes at the same point with or without Silence in between: sweeps
/// depend on the inputs only. Allocates nothing after the first few sweeps and never throws after construction. One
/// owner.
class Ingest {
 public:
  /// Receives a finished sweep, see SweepBuilder::Sink.
  using Sink = std::function<void(Sweep& sweep, const SweepCut& cut)>;

  /// Takes `lidars` opened from config.lidars. `health_sink` receives each change of health of a motion source.
  Ingest(const Config& config, LidarRouter lidars, Sink sink, MotionSources::HealthSink health_sink = {});
  Ingest(const Ingest&) = delete;
  Ingest& operator=(const Ingest&) = delete;

  void process(const Input& input) {
    std::visit([this](const auto& one) { process(one); }, input);
  }
  void process(const Datagram& datagram);
  void process(const CloudInput& cloud);
  void process(const ImuInput& imu) { process_motion(imu); }
  void process(const OdometryInput& odometry) { process_motion(odometry); }
  void process(const ExternalHealth& verdict) {
    sweeps_.sources().set_outside_verdict(verdict.source, verdict.healthy);
  }
  void process(const Silence& silence) { sweeps_.advance(silence.now); }
  void process(const EndOfInput&) { sweeps_.finish(); }

  /// Accepts the feedback of the last registration on the motion sources; effective from the next window on.
  void apply(const RegistrationFeedback& feedback) { sweeps_.sources().on_feedback(feedback); }

  /// Returns the lidars; the counters of this and the following belong to the thread that calls process().
  [[nodiscard]] const LidarRouter& lidars() const { return lidars_; }
  /// Returns the decoder of the lidar with this index; nullptr for one that sends packets.
  [[nodiscard]] const CloudDecoder* clouds_of(std::size_t lidar) const { return clouds_[lidar].get(); }
  [[nodiscard]] const MotionSources& sources() const { return sweeps_.sources(); }
  [[nodiscard]] const SweepBuilder& sweeps() const { return sweeps_; }
  [[nodiscard]] const StageStopwatch& stages() const { return stages_; }

  /// Returns the largest possible number of points in a sweep.
  static std::size_t max_points(const Config& config);

 private:
  /// Forwards stages to the stopwatch and records the cut of a sweep, which opens Stage::filter.
  class CutWatch : public StageClock {
   public:
    explicit CutWatch(StageStopwatch& stages) : stages_(stages) {}
    void enter(Stage stage) override;
    void leave() override { stages_.leave(); }
    [[nodiscard]] const MachineTime& cut_start() const { return cut_start_; }

   private:
    StageStopwatch& stages_;
    MachineTime cut_start_;
  };

  template <class MotionInput> void process_motion(const MotionInput& input);

  Sink sink_;
  StageStopwatch stages_;
  CutWatch cut_watch_{stages_};
  LidarRouter lidars_;
  std::vector<std::optional<SourceId>> imu_of_lidar_; ///< by lidar; empty without a built-in IMU
  std::vector<std::unique_ptr<CloudDecoder>> clouds_; ///< by lidar; nullptr for one that sends packets
  SweepBuilder sweeps_;
};

} // namespace locus::daemon
