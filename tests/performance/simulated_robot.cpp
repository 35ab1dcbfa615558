// SPDX-License-Identifier: Apache-2.0
#include "simulated_robot.hpp"

#include <algorithm>
#include <utility>

namespace locus::performance {

namespace {

constexpr SourceId kWheels{0}, kImu{1}; ///< among the motion sources of the default configuration

} // namespace

SimulatedRobot::SimulatedRobot(sim::WorldMaker make_world, const sim::SensorChoice& sensors, Duration duration)
    : world_(make_world(kSeed)), robot_(sim::make_husky(sensors, kSeed)),
      trajectory_(sim::drive_about(world_, robot_, duration, {}, kSeed)), end_(trajectory_.start() + duration),
      wheels_(trajectory_, robot_.sensors.odometry.front().rate_hz, robot_.sensors.odometry.front().faults, kSeed + 1),
      imu_(trajectory_, 200.0, robot_.sensors.imu->faults, kSeed, robot_.sensors.imu->T_base_imu),
      waiting_wheels_(wheels_.next()), waiting_imu_(imu_.next()) {
  for (const sim::NamedLidar& lidar : robot_.sensors.lidars)
    lidars_.push_back({sim::SyntheticLidar(world_.scene, trajectory_, lidar.options), {}});
  for (Lidar& lidar : lidars_)
    lidar.waiting = lidar.source.next();
}

Config SimulatedRobot::config() const {
  Config config;
  config.lidars.clear();
  for (const sim::NamedLidar& lidar : robot_.sensors.lidars) {
    LidarOptions& options = config.lidars.emplace_back();
    options.name = lidar.name;
    options.model = std::get<velodyne::Model>(lidar.options.model);
    options.port = lidar.options.port;
    options.T_base_lidar = lidar.options.T_base_lidar;
  }
  config.motion_sources[index_of(kImu)].T_base_source = robot_.sensors.imu->T_base_imu;
  config.odometry.threads = 1;
  return config;
}

daemon::Input SimulatedRobot::next(Duration) {
  if (Lidar* given = std::exchange(given_, nullptr))
    given->waiting = given->source.next();
  const auto lidar = std::min_element(lidars_.begin(), lidars_.end(), [](const Lidar& a, const Lidar& b) {
    return a.waiting.receive_stamp < b.waiting.receive_stamp;
  });
  const Stamp datagram = lidar->waiting.receive_stamp;
  if (std::min({datagram, waiting_wheels_.arrival, waiting_imu_.arrival}) > end_)
    return daemon::EndOfInput{};
  if (waiting_wheels_.arrival <= std::min(datagram, waiting_imu_.arrival))
    return daemon::OdometryInput{kWheels, std::exchange(waiting_wheels_, wheels_.next())};
  if (waiting_imu_.arrival <= datagram)
    return daemon::ImuInput{kImu, std::exchange(waiting_imu_, imu_.next())};
  given_ = &*lidar;
  return lidar->waiting;
}

} // namespace locus::performance
