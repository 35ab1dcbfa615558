// SPDX-License-Identifier: Apache-2.0
// Calibration files of one lidar.
#include <cmath>

#include "drivers/velodyne/calibration.hpp"
#include "fuzz/memory_file.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace locus;
  using fuzz::demand;
  static const fuzz::MemoryFile kFile;
  const auto calibration = velodyne::read_calibration(kFile.with(fuzz::text_of(data, size)));
  if (!calibration)
    return 0;
  demand(calibration->laser_count <= velodyne::kMaxLasers && calibration->distance_resolution_m > 0.0);
  for (const velodyne::Laser& laser : calibration->lasers()) {
    demand(laser.ring < calibration->laser_count);
    demand(std::isfinite(laser.elevation_rad) && std::isfinite(laser.azimuth_offset_rad));
  }
  return 0;
}
