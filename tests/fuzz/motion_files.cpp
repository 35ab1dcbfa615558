// SPDX-License-Identifier: Apache-2.0
// Tables of motion: each input is read as one of an IMU, of odometry, of true poses and of what goes with a table. What
// is read is judged as a replay does.
#include <cmath>

#include "core/health_monitor.hpp"
#include "drivers/motion_files.hpp"
#include "fuzz/memory_file.hpp"

namespace locus {
namespace {

using fuzz::demand;

template <class Sample> void judge(const Expected<std::vector<Sample>, std::string>& samples, SourceKind kind) {
  if (!samples)
    return;
  HealthMonitor health{{.name = "fuzz", .kind = kind, .T_base_source = {}}};
  for (const Sample& sample : *samples)
    static_cast<void>(health.judge(sample));
}

template <class Sample> void play(const std::filesystem::path& file) {
  auto samples = MotionSamples<Sample>::open(file);
  if (!samples)
    return;
  const auto arrivals = samples->arrivals();
  demand(arrivals.has_value() == (samples->front() != nullptr));
  for (Stamp last = Stamp::min(); samples->front() != nullptr; samples->pop()) {
    demand(samples->front()->arrival >= last && samples->front()->arrival <= arrivals->last);
    last = samples->front()->arrival;
  }
}

} // namespace
} // namespace locus

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace locus;
  static const fuzz::MemoryFile kFile;
  const std::string text{fuzz::text_of(data, size)};
  judge(parse_samples<ImuSample>(text, "imu.csv"), SourceKind::imu);
  judge(parse_samples<OdometrySample>(text, "wio.tum"), SourceKind::odometry);
  const std::filesystem::path file = kFile.with(data, size);
  play<ImuSample>(file);
  play<OdometrySample>(file);
  if (const auto poses = read_trajectory(file))
    for (const StampedPose& pose : *poses)
      demand(pose.T_source_base.finite());
  return 0;
}
