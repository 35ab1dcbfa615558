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

/// Points of a sweep's file in the memory layout of a message. One owner; memory is reused from sweep to sweep.
struct SweepPoints {
  struct Field {
    std::string name;
    std::uint32_t offset = 0;
    CloudView::Type type{};
  };
  static constexpr std::size_t kMostBytes = 64'000'000; ///< of its records; the limit on a message

  std::vector<Field> fields;
  std::uint32_t width = 0, height = 1, point_step = 0;
  std::vector<std::byte> data;

  /// Returns a view, valid until this is changed.
  [[nodiscard]] CloudView view(Stamp stamp) const;
};

/// Each of these replaces `points`. They return what is wrong with the file, without its name, and then `points` are
/// invalid; "line: problem" for text formats.

/// Reads a .pcd, all three encodings. Skips fields of several numbers; converts 64-bit integers to double.
std::optional<std::string> read_pcd_points(const std::filesystem::path& file, SweepPoints& points);

/// Reads a .bin in KITTI's format: x, y, z in metres and the intensity from 0 to 1, scaled to 0 to 255.
std::optional<std::string> read_bin_points(const std::filesystem::path& file, SweepPoints& points);

/// Reads a .bin of KITTI's HDL-64E, adding the ring of each return, derived from the order of the points, and raising
/// the vertical angles by `raised_deg`. Points in another order get no ring.
std::optional<std::string> read_kitti_sweep(const std::filesystem::path& file, double raised_deg, SweepPoints& points);

} // namespace locus::tools
