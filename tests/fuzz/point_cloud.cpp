// SPDX-License-Identifier: Apache-2.0
// True maps in PLY and PCD; sweeps in PCD.
#include "accuracy/point_cloud_file.hpp"
#include "drivers/clouds/cloud_decoder.hpp"
#include "fuzz/memory_file.hpp"
#include "sweep_folder/sweep_points.hpp"

namespace {

using namespace locus;
using fuzz::demand;

void read_map(const std::filesystem::path& file, std::size_t size) {
  const auto cloud = PointCloudFile::open(file);
  if (!cloud)
    return;
  std::uint64_t seen = 0;
  const auto problem = cloud->walk([&](std::span<const Eigen::Vector3d> points) {
    for (const Eigen::Vector3d& point : points)
      demand(point.allFinite());
    seen += points.size();
  });
  demand(seen <= cloud->points() && seen <= size);
}

void read_sweep(const std::filesystem::path& file) {
  static CloudDecoder decoder{0};
  static tools::SweepPoints points;
  if (tools::read_pcd_points(file, points))
    return;
  demand(points.data.size() == std::size_t{points.width} * points.height * points.point_step);
  const Stamp stamp = stamp_from_ns(1'700'000'000'000'000'000);
  if (decoder.begin(points.view(stamp), stamp))
    return;
  while (decoder.next() != nullptr)
    ;
}

} // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const fuzz::MemoryFile kFile;
  const std::filesystem::path file = kFile.with(fuzz::text_of(data, size));
  read_map(file, size);
  read_sweep(file);
  return 0;
}
