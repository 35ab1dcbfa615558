// SPDX-License-Identifier: Apache-2.0
#include "core/recording.hpp"

#include <stdexcept>
#include <utility>

#include "drivers/files/capture.hpp"
#include "support/scenes.hpp"
#include "support/test_data.hpp"

namespace locus::test {

namespace {

constexpr std::size_t kMaxReturnsPerSweep = 200'000; ///< an HDL-32E produces 140 000 at 300 rpm

LidarInput open_lidar(Isa isa) {
  LidarOptions options;
  options.isa = isa;
  Expected<LidarInput, std::string> lidar = LidarInput::open(options, 0);
  if (!lidar)
    throw std::runtime_error(lidar.error());
  return std::move(*lidar);
}

} // namespace

Recording Recording::synthetic(const sim::Scene& scene, const sim::Trajectory& trajectory,
                               const sim::SyntheticLidarOptions& lidar, Duration duration) {
  Recording recording;
  sim::SyntheticLidar source(scene, trajectory, lidar);
  const Stamp end = trajectory.start() + duration;
  for (Datagram datagram = source.next(); datagram.receive_stamp <= end; datagram = source.next())
    recording.keep(datagram);
  return recording;
}

std::optional<Recording> Recording::real(const std::string& name) {
  const std::filesystem::path file = test_data() / "velodyne" / (name + ".pcap");
  if (!std::filesystem::exists(file))
    return std::nullopt;
  Expected<Capture, std::string> capture = Capture::open(file);
  if (!capture)
    throw std::runtime_error(capture.error());
  Recording recording;
  while (const Datagram* datagram = capture->next())
    recording.keep(*datagram);
  return recording;
}

void Recording::keep(const Datagram& datagram) {
  if (datagram.payload.size() != velodyne::kDataPacketBytes)
    return;
  const auto& payload = payloads_.emplace_back(datagram.payload.begin(), datagram.payload.end());
  datagrams_.push_back(datagram);
  datagrams_.back().payload = payload;
}

Recording plant_recording(Duration duration) {
  const sim::Scene scene = sim::plant();
  const sim::Trajectory trajectory(sim::plant_course(duration, 1.0), sim::plant_start());
  sim::SyntheticLidarOptions lidar;
  lidar.T_base_lidar.translation.z() = 0.75;
  lidar.range_noise_m = 0.02;
  return Recording::synthetic(scene, trajectory, lidar, duration);
}

SweepsOfRecording::SweepsOfRecording(const Recording& recording, const SweepOptions& options, StageClock* clock)
    : recording_(recording), clock_(clock), lidar_(open_lidar(options.isa)),
      builder_(
          options, {Pose{}}, MotionSources({}, Fusion::combined), kMaxReturnsPerSweep,
          [this](Sweep& sweep) {
            std::swap(sweep_, sweep);
            sweep.sequence = sweep_.sequence; // counted by the builder
            ready_ = true;
          },
          clock) {}

const LidarPacket* SweepsOfRecording::decode(const Datagram& datagram) {
  const StageScope scope(clock_, Stage::decode);
  return lidar_.receive(datagram);
}

Sweep* SweepsOfRecording::next() {
  ready_ = false;
  while (!ready_ && played_ < recording_.datagrams().size()) {
    const Datagram& datagram = recording_.datagrams()[played_++];
    if (const LidarPacket* packet = decode(datagram))
      builder_.add(*packet, datagram.receive_stamp);
  }
  if (!ready_ && !std::exchange(finished_, true))
    builder_.finish();
  return ready_ ? &sweep_ : nullptr;
}

std::vector<Sweep> sweeps_of(const Recording& recording, const SweepOptions& options) {
  std::vector<Sweep> sweeps;
  SweepsOfRecording source(recording, options);
  while (const Sweep* sweep = source.next())
    sweeps.push_back(*sweep);
  return sweeps;
}

SweepOptions every_return() {
  SweepOptions options;
  options.segment_filter.enabled = false;
  return options;
}

} // namespace locus::test
