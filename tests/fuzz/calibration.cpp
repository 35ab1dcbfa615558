// SPDX-License-Identifier: Apache-2.0
// Calibration files of one lidar: Velodyne and Hesai.
#include <cmath>

#include "drivers/hesai/calibration.hpp"
#include "drivers/velodyne/calibration.hpp"
#include "fuzz/memory_file.hpp"

namespace {

template <class Calibration> void check(const Calibration& calibration) {
  using locus::fuzz::demand;
  demand(calibration.laser_count <= calibration.storage.size());
  for (const auto& laser : calibration.lasers()) {
    demand(laser.ring < calibration.laser_count);
    demand(std::isfinite(laser.elevation_rad) && std::isfinite(laser.azimuth_offset_rad));
  }
}

} // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace locus;
  static const fuzz::MemoryFile kFile;
  const auto& file = kFile.with(fuzz::text_of(data, size));
  if (const auto calibration = velodyne::read_calibration(file)) {
    fuzz::demand(calibration->distance_resolution_m > 0.0);
    check(*calibration);
  }
  if (const auto calibration = hesai::read_calibration(file)) {
    fuzz::demand(calibration->laser_count > 0);
    check(*calibration);
  }
  return 0;
}
