// SPDX-License-Identifier: Apache-2.0
#include "locus_replay/map_file.hpp"

#include <bit>

#include "locus_replay/output_file.hpp"

namespace locus::tools {

void write_map(const std::filesystem::path& path, std::span<const SurfacePoint> points) {
  static_assert(std::endian::native == std::endian::little, "PCD holds the machine's bytes, everybody's are little");
  static_assert(sizeof(SurfacePoint) == 6 * sizeof(float));
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
  file.write(std::as_bytes(points));
  file.close();
}

} // namespace locus::tools
