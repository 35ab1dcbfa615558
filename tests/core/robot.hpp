// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <vector>

#include "core/base/options.hpp"
#include "core/ingest/sweep_builder.hpp"
#include "core/odometry/odometry.hpp"
#include "drivers/velodyne/decoder.hpp"
#include "locus_sim/scene.hpp"
#include "locus_sim/synthetic_lidar.hpp"
#include "locus_sim/synthetic_sources.hpp"
#include "locus_sim/trajectory.hpp"

namespace locus::test {

inline constexpr std::size_t kMaxReturns = 100'000; ///< per sweep; a VLP-16 produces 30 000

/// Sensors of a test robot: by default a level VLP-16 on a mast and no motion source.
struct RobotSetup {
  std::vector<sim::SyntheticLidarOptions> lidars{on_mast()};
  std::optional<sim::OdometryFaults> wheels; ///< 50 Hz, first in the queue
  std::optional<sim::ImuFaults> imu;         ///< 200 Hz
  double wheels_rate_hz = 50.0;
  SweepOptions sweep;
  Fusion fusion = Fusion::combined;
  std::function<bool(std::size_t lidar, Stamp)> is_lost = [](std::size_t, Stamp) { return false; }; ///< packets
  std::function<bool(std::size_t source, Stamp)> is_silent = [](std::size_t, Stamp) { return false; };
  std::function<double(Stamp)> gyro_error_radps = [](Stamp) { return 0.0; }; ///< about z

  static sim::SyntheticLidarOptions on_mast();
  [[nodiscard]] std::vector<MotionSourceOptions> motion_sources() const;
  [[nodiscard]] OdometryOptions odometry() const;
};

/// A stream of decoded packets of one synthetic lidar, stamped with the true time. Not thread-safe.
class PacketStream {
 public:
  /// `scene` and `trajectory` must outlive this.
  PacketStream(const sim::Scene& scene, const sim::Trajectory& trajectory, const sim::SyntheticLidarOptions& options,
               std::uint8_t index);

  [[nodiscard]] const LidarPacket& packet() const { return packet_; }
  [[nodiscard]] Stamp arrival() const { return packet_.stamp + packet_.duration; }
  void advance();

 private:
  sim::SyntheticLidar lidar_;
  velodyne::Decoder decoder_;
  LidarPacket packet_;
};

/// Drives the robot for `duration` and passes each sweep to `sink`. Returns the builder's counters.
SweepBuilder::Counters drive(const sim::Scene& scene, const sim::Trajectory& trajectory, const RobotSetup& setup,
                             Duration duration, const SweepBuilder::Sink& sink);

/// Returns all sweeps of a drive.
std::vector<Sweep> sweeps_of(const sim::Scene& scene, const sim::Trajectory& trajectory, const RobotSetup& setup,
                             Duration duration);

/// Returns the true pose of the base at `to` in the base frame at `from`.
Pose true_motion(const sim::Trajectory& trajectory, Stamp from, Stamp to);

} // namespace locus::test
