// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "core/base/stamp.hpp"
#include "drivers/clouds/cloud_view.hpp"

namespace locus::tools {

/// The points of a sweep's file as a message with them would lie in memory. One owner; memory is used again from sweep
/// to sweep.
struct SweepPoints {
  struct Field {
    std::string name;
    std::uint32_t offset = 0;
    CloudView::Type type{};
  };
  static constexpr std::size_t kMostBytes = 64'000'000; ///< of its records; as long as a message may be

  std::vector<Field> fields;
  std::uint32_t width = 0, height = 1, point_step = 0;
  std::vector<std::byte> data;

  /// Valid until this is changed.
  [[nodiscard]] CloudView view(Stamp stamp) const;
};

/// Each of these replaces `points`. They return what is wrong with the file, without its name, and then `points` are of
/// no use; "line: what" where it has lines.

/// Of a .pcd, all three encodings. A field of several numbers is left out, and a whole number of 64 bits made a double.
std::optional<std::string> read_pcd_points(const std::filesystem::path& file, SweepPoints& points);

/// Of a .bin as KITTI has it: x, y, z in metres and the intensity from 0 to 1, which becomes 0 to 255.
std::optional<std::string> read_bin_points(const std::filesystem::path& file, SweepPoints& points);

/// The same of KITTI's HDL-64E itself, with the ring of each return, which the order of the points tells; the vertical
/// angles are made larger by `raised_deg`. Points that are not in that order have no ring.
std::optional<std::string> read_kitti_sweep(const std::filesystem::path& file, double raised_deg, SweepPoints& points);

} // namespace locus::tools
