// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <vector>

#include "drivers/net/datagram.hpp"
#include "locus_sim/ouster_sensor.hpp"
#include "locus_sim/synthetic_sources.hpp"

namespace locus::sim {

/// Inertial unit of a simulated Ouster: 100 packets of 48 bytes per second, mounted as in its metadata, on the clock of
/// its columns. A reading arrives at its stamp. One owner.
class OusterImu {
 public:
  /// The trajectory must outlive it. `lidar`: options of the enclosing SyntheticLidar.
  OusterImu(const Trajectory& trajectory, const SyntheticLidarOptions& lidar, const ImuFaults& faults);

  Datagram next(); ///< starts at the start of the trajectory

 private:
  OusterSensor sensor_;
  SyntheticImu imu_;
  std::uint32_t source_ip_;
  std::uint16_t port_;
  std::vector<std::byte> packet_;
};

} // namespace locus::sim
