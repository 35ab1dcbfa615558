// SPDX-License-Identifier: Apache-2.0
// True maps, PLY and PCD.
#include "accuracy/point_cloud_file.hpp"
#include "fuzz/memory_file.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace locus;
  using fuzz::demand;
  static const fuzz::MemoryFile kFile;
  const auto cloud = PointCloudFile::open(kFile.with(fuzz::text_of(data, size)));
  if (!cloud)
    return 0;
  std::uint64_t seen = 0;
  const auto problem = cloud->walk([&](std::span<const Eigen::Vector3d> points) {
    for (const Eigen::Vector3d& point : points)
      demand(point.allFinite());
    seen += points.size();
  });
  demand(seen <= cloud->points() && seen <= size);
  return 0;
}
