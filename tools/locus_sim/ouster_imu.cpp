// SPDX-License-Identifier: Apache-2.0
#include "locus_sim/ouster_imu.hpp"

#include "locus_sim/dice.hpp"
#include "locus_sim/ouster_packet.hpp"

namespace locus::sim {
namespace {

constexpr double kRate_hz = 100;
constexpr double kStandardGravity_mps2 = 9.80665; // unit of the sensor's readings

} // namespace

OusterImu::OusterImu(const Trajectory& trajectory, const SyntheticLidarOptions& lidar, const ImuFaults& faults)
    : sensor_(lidar, trajectory.start()), imu_(trajectory, kRate_hz, faults, seed_for(lidar.seed, "imu"),
                                               lidar.T_base_lidar * sensor_.metadata().T_sensor_imu),
      source_ip_(lidar.source_ip), port_(lidar.imu_port) {}

Datagram OusterImu::next() {
  const ImuSample sample = imu_.next();
  packet_ = ouster_imu_packet(static_cast<std::uint64_t>(sensor_.shown_at_true(sample.stamp).count()),
                              (sample.specific_force_mps2 / kStandardGravity_mps2).cast<float>(),
                              (sample.angular_velocity_radps / kRadPerDeg).cast<float>());
  return {.payload = packet_,
          .source_ip = source_ip_,
          .source_port = port_,
          .destination_port = port_,
          .receive_stamp = sample.arrival};
}

} // namespace locus::sim
