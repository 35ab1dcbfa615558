// SPDX-License-Identifier: Apache-2.0
#include "daemon/drive.hpp"

#include <algorithm>
#include <stdexcept>

#include "daemon/ingest.hpp"
#include "locus_sim/synthetic_lidar.hpp"
#include "locus_sim/synthetic_sources.hpp"
#include "locus_sim/trajectory.hpp"
#include "support/scenes.hpp"

namespace locus::daemon {

namespace {

constexpr Duration kDuration = std::chrono::seconds{8};

} // namespace

Config Drive::config() {
  Config config;
  config.lidars.front().T_base_lidar.translation.z() = 0.75;
  return config;
}

const Drive& Drive::instance() {
  static const Drive drive;
  return drive;
}

Drive::Drive() {
  const sim::Scene scene = sim::room();
  const sim::Trajectory trajectory(sim::room_course(kDuration, 1.0), sim::room_start());
  const Stamp end = trajectory.start() + kDuration;

  sim::SyntheticLidarOptions mounted;
  mounted.T_base_lidar = config().lidars.front().T_base_lidar;
  sim::SyntheticLidar lidar(scene, trajectory, mounted);
  for (Datagram datagram = lidar.next(); datagram.receive_stamp < end; datagram = lidar.next()) {
    auto& payload = payloads_.emplace_back();
    std::copy(datagram.payload.begin(), datagram.payload.end(), payload.begin());
    datagram.payload = payload;
    inputs_.emplace_back(datagram);
  }
  sim::SyntheticOdometry wheels(trajectory, 50.0);
  for (OdometrySample sample = wheels.next(); sample.arrival < end; sample = wheels.next())
    inputs_.emplace_back(OdometryInput{SourceId{0}, sample});
  sim::SyntheticImu imu(trajectory, 200.0);
  for (ImuSample sample = imu.next(); sample.arrival < end; sample = imu.next())
    inputs_.emplace_back(ImuInput{SourceId{1}, sample});
  std::stable_sort(inputs_.begin(), inputs_.end(),
                   [](const Input& a, const Input& b) { return arrival_of(a, {}) < arrival_of(b, {}); });
}

Input DriveInput::next(Duration) {
  const std::vector<Input>& inputs = Drive::instance().inputs();
  return given_ < inputs.size() ? inputs[given_++] : Input{EndOfInput{}};
}

std::vector<ProcessedSweep> process_in_one_thread(const Config& config) {
  std::vector<ProcessedSweep> processed;
  SweepProcessor processor(config);
  const auto process = [&](Ingest& ingest, const Sweep& sweep) {
    processed.push_back(processor.process(sweep, {MachineTime::now(), {}}));
    ingest.apply(processor.odometry().feedback());
  };
  Ingest ingest(config, open_lidars(config), [&](Sweep& sweep, const SweepCut&) { process(ingest, sweep); });
  for (const Input& input : Drive::instance().inputs())
    ingest.process(input);
  ingest.process(EndOfInput{});
  return processed;
}

LidarRouter open_lidars(const Config& config) {
  auto lidars = LidarRouter::open(config.lidars);
  if (!lidars)
    throw std::runtime_error(lidars.error());
  return std::move(*lidars);
}

} // namespace locus::daemon
