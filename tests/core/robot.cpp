// SPDX-License-Identifier: Apache-2.0
#include "core/robot.hpp"

#include <algorithm>
#include <iterator>
#include <stdexcept>

namespace locus::test {

sim::SyntheticLidarOptions RobotSetup::on_mast() {
  sim::SyntheticLidarOptions lidar;
  lidar.T_base_lidar.translation.z() = 0.75;
  return lidar;
}

std::vector<MotionSourceOptions> RobotSetup::motion_sources() const {
  std::vector<MotionSourceOptions> sources;
  if (wheels)
    sources.push_back({"wheels", SourceKind::odometry, {}});
  if (imu)
    sources.push_back({"imu", SourceKind::imu, {}});
  return sources;
}

OdometryOptions RobotSetup::odometry() const {
  OdometryOptions options;
  options.fusion = fusion;
  options.threads = 1;
  return options;
}

PacketStream::PacketStream(const sim::Scene& scene, const sim::Trajectory& trajectory,
                           const sim::SyntheticLidarOptions& options, std::uint8_t index)
    : lidar_(scene, trajectory, options),
      decoder_({.model = std::get<velodyne::Model>(options.model), .return_mode = options.return_mode}) {
  packet_.lidar = index;
  advance();
}

void PacketStream::advance() {
  const Datagram datagram = lidar_.next();
  if (decoder_.decode(datagram.payload, packet_))
    throw std::logic_error("the synthetic lidar made a packet that the decoder refuses");
  packet_.stamp = datagram.receive_stamp - packet_.duration;
}

SweepBuilder::Counters drive(const sim::Scene& scene, const sim::Trajectory& trajectory, const RobotSetup& setup,
                             Duration duration, const SweepBuilder::Sink& sink) {
  std::vector<PacketStream> lidars;
  std::vector<Pose> T_base_lidar;
  for (const sim::SyntheticLidarOptions& options : setup.lidars) {
    lidars.emplace_back(scene, trajectory, options, static_cast<std::uint8_t>(lidars.size()));
    T_base_lidar.push_back(options.T_base_lidar);
  }
  sim::SyntheticOdometry wheels(trajectory, setup.wheels_rate_hz, setup.wheels.value_or(sim::OdometryFaults{}));
  sim::SyntheticImu imu(trajectory, 200.0, setup.imu.value_or(sim::ImuFaults{}));
  OdometrySample next_wheels = wheels.next();
  ImuSample next_imu = imu.next();
  SweepBuilder builder(setup.sweep, T_base_lidar, MotionSources(setup.motion_sources(), setup.fusion), kMaxReturns,
                       sink);
  const std::size_t imu_index = setup.wheels ? 1 : 0;

  for (const Stamp end = trajectory.start() + duration;;) {
    const auto next = std::min_element(lidars.begin(), lidars.end(), [](const PacketStream& a, const PacketStream& b) {
      return a.arrival() < b.arrival();
    });
    const Stamp arrival = next->arrival();
    if (arrival > end)
      break;
    for (; setup.wheels && next_wheels.stamp <= arrival; next_wheels = wheels.next())
      if (!setup.is_silent(0, next_wheels.stamp))
        builder.sources().add(SourceId{0}, next_wheels);
    for (; setup.imu && next_imu.stamp <= arrival; next_imu = imu.next()) {
      next_imu.angular_velocity_radps.z() += setup.gyro_error_radps(next_imu.stamp);
      if (!setup.is_silent(imu_index, next_imu.stamp))
        builder.sources().add(SourceId{imu_index}, next_imu);
    }
    builder.advance(arrival);
    if (!setup.is_lost(static_cast<std::size_t>(std::distance(lidars.begin(), next)), arrival))
      builder.add(next->packet(), arrival);
    next->advance();
  }
  builder.finish();
  return builder.counters();
}

std::vector<Sweep> sweeps_of(const sim::Scene& scene, const sim::Trajectory& trajectory, const RobotSetup& setup,
                             Duration duration) {
  std::vector<Sweep> sweeps;
  drive(scene, trajectory, setup, duration, [&](const Sweep& sweep) { sweeps.push_back(sweep); });
  return sweeps;
}

Pose true_motion(const sim::Trajectory& trajectory, Stamp from, Stamp to) {
  return trajectory.T_world_base(from).inverse() * trajectory.T_world_base(to);
}

} // namespace locus::test
