// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "drivers/ouster/metadata.hpp"
#include "locus_sim/ouster_packet.hpp"

namespace locus::test {

using OusterTestPacket = sim::OusterPacket;
using locus::put_little_endian;
using sim::ouster_imu_packet;

/// A typical Ouster sensor: 32 beams from 15 degrees down to -16, in groups of four side by side.
inline ouster::Metadata ouster_metadata(ouster::Profile profile = ouster::Profile::rng19, std::size_t pixels = 32,
                                        std::size_t columns = 1024) {
  ouster::Metadata metadata;
  metadata.product_line = "OS-1-" + std::to_string(pixels);
  metadata.serial_number = 122'201'000'998;
  metadata.init_id = 7'109'750;
  metadata.profile = profile;
  metadata.pixels_per_column = pixels;
  metadata.columns_per_frame = columns;
  metadata.last_column = columns - 1;
  for (std::size_t i = 0; i < pixels; ++i) {
    metadata.altitude_rad[i] = kRadPerDeg * (15.0 - 31.0 * static_cast<double>(i) / static_cast<double>(pixels - 1));
    metadata.azimuth_rad[i] = kRadPerDeg * (4.2 - 2.8 * static_cast<double>(i % 4));
  }
  metadata.beam_origin_radius_m = 0.015806;
  metadata.T_sensor_lidar = {Eigen::Quaterniond{0.0, 0.0, 0.0, 1.0}, {0.0, 0.0, 0.03618}};
  metadata.T_sensor_imu = {Eigen::Quaterniond::Identity(), {0.006253, -0.011775, 0.007645}};
  return metadata;
}

} // namespace locus::test
