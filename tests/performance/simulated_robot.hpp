// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "config/config.hpp"
#include "daemon/input.hpp"
#include "locus_sim/robot.hpp"
#include "locus_sim/synthetic_lidar.hpp"
#include "locus_sim/synthetic_sources.hpp"
#include "locus_sim/world.hpp"

namespace locus::performance {

/// The husky of locus-sim, simulated on demand: each input of its computer is generated when requested. Not
/// thread-safe.
class SimulatedRobot : public daemon::InputSource {
 public:
  SimulatedRobot(sim::WorldMaker make_world, const sim::SensorChoice& sensors, Duration duration);
  SimulatedRobot(const SimulatedRobot&) = delete;
  SimulatedRobot& operator=(const SimulatedRobot&) = delete;

  /// Returns its configuration, as in the config.yaml of a capture folder; one thread.
  [[nodiscard]] Config config() const;

  [[nodiscard]] Stamp start() const { return trajectory_.start(); }

  daemon::Input next(Duration timeout) override;

 private:
  struct Lidar {
    sim::SyntheticLidar source;
    Datagram waiting;
  };
  static constexpr std::uint64_t kSeed = 1;

  sim::World world_;
  sim::Robot robot_;
  sim::Trajectory trajectory_;
  Stamp end_;
  std::vector<Lidar> lidars_;
  Lidar* given_ = nullptr; ///< its datagram is valid until the next call
  sim::SyntheticOdometry wheels_;
  sim::SyntheticImu imu_;
  OdometrySample waiting_wheels_;
  ImuSample waiting_imu_;
};

} // namespace locus::performance
