// SPDX-License-Identifier: Apache-2.0
#include "locus_replay/map_file.hpp"

#include <array>

#include "locus_replay/cloud_files.hpp"

namespace locus::tools {

void write_map(const std::filesystem::path& path, std::span<const SurfacePoint> points) {
  constexpr std::array<CloudColumn, 6> kColumns{{{"x"}, {"y"}, {"z"}, {"normal_x"}, {"normal_y"}, {"normal_z"}}};
  static_assert(sizeof(SurfacePoint) == kColumns.size() * sizeof(float));
  write_pcd(path, kColumns, std::as_bytes(points));
}

} // namespace locus::tools
