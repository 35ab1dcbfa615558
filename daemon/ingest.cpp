// SPDX-License-Identifier: Apache-2.0
#include "daemon/ingest.hpp"

#include <algorithm>
#include <utility>

#include "core/ingest/ring_segments.hpp"
#include "drivers/packet_decoder.hpp"

namespace locus::daemon {

namespace {

constexpr Duration kMaxRevolution = std::chrono::milliseconds{200}; ///< at 300 rpm, the lowest rate of all models

std::vector<Pose> mounts(const std::vector<LidarOptions>& lidars) {
  std::vector<Pose> T_base_lidar;
  T_base_lidar.reserve(lidars.size());
  for (const LidarOptions& lidar : lidars)
    T_base_lidar.push_back(lidar.T_base_lidar);
  return T_base_lidar;
}

std::vector<std::unique_ptr<CloudDecoder>> cloud_decoders(const std::vector<LidarOptions>& lidars) {
  std::vector<std::unique_ptr<CloudDecoder>> decoders;
  for (std::size_t i = 0; i < lidars.size(); ++i)
    decoders.push_back(lidars[i].gives_clouds()
                           ? std::make_unique<CloudDecoder>(static_cast<std::uint8_t>(i), lidars[i].point_times)
                           : nullptr);
  return decoders;
}

std::vector<std::optional<SourceId>> imus(const Config& config) {
  std::vector<std::optional<SourceId>> sources;
  for (const LidarOptions& lidar : config.lidars) {
    std::optional<SourceId>& source = sources.emplace_back();
    for (std::size_t i = 0; i < config.motion_sources.size(); ++i)
      if (config.motion_sources[i].of_lidar && config.motion_sources[i].name == lidar.name + "_imu")
        source = SourceId{i};
  }
  return sources;
}

/// Returns the largest number of returns in a sweep; surplus memory is reserved, but never touched.
std::size_t max_returns(const Config& config) {
  const Duration period = std::max(kMaxRevolution, config.sweep.sweep_period.value_or(kMaxRevolution));
  std::size_t returns = 0;
  for (const LidarOptions& lidar : config.lidars)
    returns += most_returns(lidar, period);
  return returns;
}

} // namespace

Ingest::Ingest(const Config& config, LidarRouter lidars, Sink sink, MotionSources::HealthSink health_sink)
    : sink_(std::move(sink)), lidars_(std::move(lidars)), imu_of_lidar_(imus(config)),
      clouds_(cloud_decoders(config.lidars)), sweeps_(
                                                  config.sweep, mounts(config.lidars),
                                                  MotionSources(config.source_options(), config.odometry.fusion,
                                                                config.odometry.motion, std::move(health_sink)),
                                                  max_returns(config),
                                                  [this](Sweep& sweep) {
                                                    const StageStopwatch::Pause pause(stages_);
                                                    sink_(sweep, {cut_watch_.cut_start(), stages_.lap()});
                                                  },
                                                  &cut_watch_) {}

void Ingest::process(const Datagram& datagram) {
  sweeps_.advance(datagram.receive_stamp);
  const LidarPacket* packet = nullptr;
  {
    const StageScope scope(&stages_, Stage::decode);
    packet = lidars_.receive(datagram);
  }
  if (packet != nullptr)
    sweeps_.add(*packet, datagram.receive_stamp);
  const LidarRouter::Imu imu = lidars_.imu();
  for (const ImuSample& sample : imu.samples)
    if (const auto source = imu_of_lidar_[imu.lidar])
      sweeps_.sources().add(*source, sample);
}

void Ingest::process(const CloudInput& cloud) {
  sweeps_.advance(cloud.arrival);
  CloudDecoder& decoder = *clouds_[cloud.lidar];
  const auto next = [&] {
    const StageScope scope(&stages_, Stage::decode);
    return decoder.next();
  };
  {
    const StageScope scope(&stages_, Stage::decode);
    if (cloud.message == nullptr)
      decoder.refuse(cloud.error);
    if (cloud.message == nullptr || decoder.begin(*cloud.message, cloud.arrival))
      return;
  }
  while (const LidarPacket* packet = next())
    sweeps_.add(*packet, cloud.arrival);
}

template <class MotionInput> void Ingest::process_motion(const MotionInput& input) {
  sweeps_.advance(input.sample.arrival);
  sweeps_.sources().add(input.source, input.sample);
}
template void Ingest::process_motion(const ImuInput&);
template void Ingest::process_motion(const OdometryInput&);

void Ingest::CutWatch::enter(Stage stage) {
  if (stage == Stage::filter)
    cut_start_ = MachineTime::now();
  stages_.enter(stage);
}

std::size_t Ingest::max_points(const Config& config) {
  const std::size_t unsegmented = config.sweep.segment_filter.enabled ? 0 : max_returns(config);
  return std::max(unsegmented, RingSegments::kMaxSegments);
}

} // namespace locus::daemon
