// SPDX-License-Identifier: Apache-2.0
#include "locus_replay/map_file.hpp"

#include <array>
#include <bit>
#include <vector>

#include <fmt/ostream.h>

#include "locus_replay/output_file.hpp"

namespace locus::tools {
namespace {

static_assert(std::endian::native == std::endian::little, "PCD holds the machine's bytes, and everybody's are little");

using PcdPoint = std::array<float, 6>; ///< x y z and the normal

std::vector<PcdPoint> points_of(const SurfaceGrid& grid) {
  std::vector<PcdPoint> points;
  for (std::size_t slot = 0; slot < grid.size(); ++slot) {
    const Surface& surface = grid.surface(slot);
    if (!surface.planar())
      continue;
    const Eigen::Vector3f p = (grid.centre(slot) + surface.mean_m.cast<double>()).cast<float>();
    const Eigen::Vector3f& n = surface.normal;
    points.push_back({p.x(), p.y(), p.z(), n.x(), n.y(), n.z()});
  }
  return points;
}

} // namespace

void write_map(const std::filesystem::path& path, const SurfaceMap& map) {
  const std::vector<PcdPoint> points = points_of(map.fine());
  OutputFile file(path);
  file.print("# .PCD v0.7 - Point Cloud Data file format\n"
             "VERSION 0.7\n"
             "FIELDS x y z normal_x normal_y normal_z\n"
             "SIZE 4 4 4 4 4 4\n"
             "TYPE F F F F F F\n"
             "COUNT 1 1 1 1 1 1\n"
             "WIDTH {0}\n"
             "HEIGHT 1\n"
             "VIEWPOINT 0 0 0 1 0 0 0\n"
             "POINTS {0}\n"
             "DATA binary\n",
             points.size());
  file.write(std::as_bytes(std::span{points}));
  file.close();
}

} // namespace locus::tools
