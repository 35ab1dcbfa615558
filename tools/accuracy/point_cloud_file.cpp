// SPDX-License-Identifier: Apache-2.0
#include "accuracy/point_cloud_file.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <charconv>
#include <cstddef>
#include <cstring>
#include <fstream>
#include <limits>
#include <string_view>
#include <system_error>
#include <vector>

#include <fmt/format.h>

#include "accuracy/pcd_header.hpp"

namespace locus {
namespace {

static_assert(std::endian::native == std::endian::little, "binary coordinates are taken as they lie in the file");

constexpr std::size_t kBlockBytes = 1 << 18; ///< read at once from a file

using Coordinate = PointCloudLayout::Coordinate;

template <class Real> double real_at(const std::byte* bytes, bool reversed) {
  std::array<std::byte, sizeof(Real)> raw;
  std::memcpy(raw.data(), bytes, sizeof(Real));
  if (reversed)
    std::ranges::reverse(raw);
  return static_cast<double>(std::bit_cast<Real>(raw));
}

double coordinate_at(const std::byte* record, const Coordinate& where, bool reversed) {
  return where.bytes == sizeof(float) ? real_at<float>(record + where.offset, reversed)
                                      : real_at<double>(record + where.offset, reversed);
}

/// Parses the coordinates in a line of text; nothing if one of them is not a number.
std::optional<Eigen::Vector3d> point_in(std::string_view line, const std::array<Coordinate, 3>& xyz) {
  Eigen::Vector3d point;
  int found = 0;
  for (std::size_t column = 0; found < 3; ++column) {
    line.remove_prefix(std::min(line.find_first_not_of(" \t\r"), line.size()));
    if (line.empty())
      return std::nullopt;
    const std::string_view word = line.substr(0, line.find_first_of(" \t\r"));
    for (Eigen::Index axis = 0; axis < 3; ++axis) {
      if (xyz[static_cast<std::size_t>(axis)].column != column)
        continue;
      const auto [stop, error] = std::from_chars(word.data(), word.data() + word.size(), point[axis]);
      if (error != std::errc{} || stop != word.data() + word.size())
        return std::nullopt;
      ++found;
    }
    line.remove_prefix(word.size());
  }
  return point;
}

} // namespace

Expected<PointCloudFile, std::string> PointCloudFile::open(const std::filesystem::path& path) {
  std::error_code ignored;
  std::ifstream stream{path, std::ios::binary};
  if (!stream || std::filesystem::is_directory(path, ignored))
    return fmt::format("{}: cannot be read; check the path and its permissions", path.string());
  const Expected<PointCloudLayout, std::string> layout = PointCloudLayout::read(stream);
  if (!layout)
    return fmt::format("{}:{}", path.string(), layout.error());
  if (layout->points == 0)
    return fmt::format("{}: contains no point; export the map again", path.string());
  const std::streamoff begin = stream.tellg();
  const std::uint64_t bytes = std::filesystem::file_size(path, ignored) - static_cast<std::uint64_t>(begin);
  if (layout->encoding != PointCloudLayout::Encoding::text && layout->points > bytes / layout->record_bytes)
    return fmt::format("{}: ends at byte {} after {} of {} points; export or copy the map again", path.string(),
                       bytes + static_cast<std::uint64_t>(begin), bytes / layout->record_bytes, layout->points);
  return PointCloudFile{path, *layout, begin};
}

std::optional<std::string> PointCloudFile::walk(const Visit& visit) const {
  std::ifstream stream{path_, std::ios::binary};
  stream.seekg(begin_);
  return layout_.encoding == PointCloudLayout::Encoding::text ? walk_text(stream, visit) : walk_binary(stream, visit);
}

std::optional<std::string> PointCloudFile::walk_text(std::istream& stream, const Visit& visit) const {
  std::vector<Eigen::Vector3d> block;
  for (std::uint64_t i = 0; i < layout_.points; ++i) {
    const std::optional<std::string> line = read_short_line(stream);
    const std::optional<Eigen::Vector3d> point = line ? point_in(*line, layout_.xyz) : std::nullopt;
    if (!point)
      return fmt::format("{}:{}: {}; export the map again", path_.string(), layout_.header_lines + i + 1,
                         line ? "not the coordinates of a point"
                              : fmt::format("the file ends after {} of {} points", i, layout_.points));
    if (point->allFinite())
      block.push_back(*point);
    if (block.size() * sizeof(Eigen::Vector3d) >= kBlockBytes || i + 1 == layout_.points) {
      visit(block);
      block.clear();
    }
  }
  return std::nullopt;
}

std::optional<std::string> PointCloudFile::walk_binary(std::istream& stream, const Visit& visit) const {
  const bool reversed = layout_.encoding == PointCloudLayout::Encoding::big_endian;
  const std::size_t block_points = std::max<std::size_t>(1, kBlockBytes / layout_.record_bytes);
  std::vector<std::byte> records(block_points * layout_.record_bytes);
  std::vector<Eigen::Vector3d> block;
  for (std::uint64_t done = 0; done < layout_.points;) {
    const std::size_t count = std::min<std::uint64_t>(block_points, layout_.points - done);
    if (!stream.read(reinterpret_cast<char*>(records.data()),
                     static_cast<std::streamsize>(count * layout_.record_bytes)))
      return fmt::format("{}: cannot be read on after point {}; was it changed meanwhile?", path_.string(), done);
    block.clear();
    for (std::size_t i = 0; i < count; ++i) {
      const std::byte* const record = records.data() + i * layout_.record_bytes;
      const Eigen::Vector3d point{coordinate_at(record, layout_.xyz[0], reversed),
                                  coordinate_at(record, layout_.xyz[1], reversed),
                                  coordinate_at(record, layout_.xyz[2], reversed)};
      if (point.allFinite())
        block.push_back(point);
    }
    visit(block);
    done += count;
  }
  return std::nullopt;
}

} // namespace locus
