// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <functional>
#include <istream>
#include <optional>
#include <span>
#include <string>
#include <utility>

#include <Eigen/Core>

#include "accuracy/point_cloud_header.hpp"

namespace locus {

/// Point cloud in a PLY or PCD file, read in blocks, so that it may be larger than memory. For the reason not to use
/// PCL see docs/decisions/027-maps-without-pcl-io.md.
///
/// Reads the element vertex of a PLY, which must come first, and all PCD encodings but binary_compressed. Any thread.
class PointCloudFile {
 public:
  using Visit = std::function<void(std::span<const Eigen::Vector3d> points)>;

  /// Reads the header and checks that the file is as long as the header requires. Fails with one line for the user.
  static Expected<PointCloudFile, std::string> open(const std::filesystem::path& path);

  /// Calls `visit` with all points, block by block, without those that are not finite. Returns what is wrong with the
  /// file, one line for the user.
  [[nodiscard]] std::optional<std::string> walk(const Visit& visit) const;

  [[nodiscard]] const std::filesystem::path& path() const { return path_; }
  [[nodiscard]] std::uint64_t points() const { return layout_.points; }

 private:
  PointCloudFile(std::filesystem::path path, const PointCloudLayout& layout, std::streamoff begin)
      : path_(std::move(path)), layout_(layout), begin_(begin) {}

  [[nodiscard]] std::optional<std::string> walk_text(std::istream& stream, const Visit& visit) const;
  [[nodiscard]] std::optional<std::string> walk_binary(std::istream& stream, const Visit& visit) const;

  std::filesystem::path path_;
  PointCloudLayout layout_;
  std::streamoff begin_; ///< position of the first point
};

} // namespace locus
