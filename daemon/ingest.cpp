// SPDX-License-Identifier: Apache-2.0
#include "daemon/ingest.hpp"

#include <algorithm>
#include <utility>
#include <vector>

#include "core/ingest/ring_segments.hpp"
#include "drivers/velodyne/model.hpp"

namespace locus::daemon {

namespace {

constexpr Duration kLongestTurn = std::chrono::milliseconds{200}; ///< at 300 rpm, the slowest that the models have

std::vector<Pose> mounts(const std::vector<LidarOptions>& lidars) {
  std::vector<Pose> T_base_lidar;
  T_base_lidar.reserve(lidars.size());
  for (const LidarOptions& lidar : lidars)
    T_base_lidar.push_back(lidar.T_base_lidar);
  return T_base_lidar;
}

/// In dual return mode, with an echo for every firing. A lidar that is yet to be recognised may be the largest; memory
/// that it then does not need is asked for, but never touched.
std::size_t max_returns(const Config& config) {
  const Duration period = std::max(kLongestTurn, config.sweep.sweep_period.value_or(kLongestTurn));
  std::size_t returns = 0;
  for (const LidarOptions& lidar : config.lidars) {
    const velodyne::ModelSpec& spec = velodyne::spec(lidar.model.value_or(velodyne::Model::vls128));
    const auto columns = static_cast<std::size_t>(period / spec.column_duration) + 1;
    returns += 2 * columns * spec.firings().size();
  }
  return returns;
}

} // namespace

Ingest::Ingest(const Config& config, LidarRouter lidars, Sink sink, MotionSources::HealthSink health_sink)
    : sink_(std::move(sink)), lidars_(std::move(lidars)),
      sweeps_(
          config.sweep, mounts(config.lidars),
          MotionSources(config.source_options(), config.odometry.fusion, config.odometry.motion,
                        std::move(health_sink)),
          max_returns(config),
          [this](Sweep& sweep) {
            const StageStopwatch::Pause pause(stages_);
            sink_(sweep, {cut_watch_.cut_began(), stages_.lap()});
          },
          &cut_watch_) {}

void Ingest::take(const Datagram& datagram) {
  sweeps_.advance(datagram.receive_stamp);
  const LidarPacket* packet = nullptr;
  {
    const StageScope scope(&stages_, Stage::decode);
    packet = lidars_.receive(datagram);
  }
  if (packet != nullptr)
    sweeps_.add(*packet, datagram.receive_stamp);
}

template <class MotionInput> void Ingest::take_motion(const MotionInput& input) {
  sweeps_.advance(input.sample.arrival);
  sweeps_.sources().add(input.source, input.sample);
}
template void Ingest::take_motion(const ImuInput&);
template void Ingest::take_motion(const OdometryInput&);

void Ingest::CutWatch::enter(Stage stage) {
  if (stage == Stage::filter)
    cut_began_ = MachineTime::now();
  stages_.enter(stage);
}

std::size_t Ingest::max_points(const Config& config) {
  const std::size_t singly = config.sweep.segment_filter.enabled ? 0 : max_returns(config);
  return std::max(singly, RingSegments::kMaxSegments);
}

} // namespace locus::daemon
