// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <vector>

#include "drivers/net/datagram.hpp"
#include "locus_sim/ouster_sensor.hpp"
#include "locus_sim/synthetic_sources.hpp"

namespace locus::sim {

/// The inertial unit of a simulated Ouster: 100 packets a second of 48 bytes, where its metadata says that it sits, by
/// the clock of its columns. A reading arrives at the instant of its stamp. One owner.
class OusterImu {
 public:
  /// The trajectory must outlive it. `lidar`: the options of the SyntheticLidar that it is in.
  OusterImu(const Trajectory& trajectory, const SyntheticLidarOptions& lidar, const ImuFaults& faults);

  Datagram next(); ///< the first is of the start of the trajectory

 private:
  OusterSensor sensor_;
  SyntheticImu imu_;
  std::uint32_t source_ip_;
  std::uint16_t port_;
  std::vector<std::byte> packet_;
};

} // namespace locus::sim
