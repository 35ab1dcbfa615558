// SPDX-License-Identifier: Apache-2.0
#include "sweep_folder/sweep_points.hpp"

#include <algorithm>
#include <array>
#include <cstring>
#include <fstream>
#include <system_error>

#include <fmt/format.h>

#include "drivers/clouds/cloud_layout.hpp"
#include "kitti/kitti_points.hpp"
#include "kitti/kitti_sweep.hpp"

namespace locus::tools {
namespace {

using Problem = std::optional<std::string>;
using Type = CloudView::Type;

constexpr float kMaxIntensity = 255.0F;

Problem read_bin(const std::filesystem::path& file, std::vector<KittiPoint>& points) {
  std::error_code error;
  const std::uintmax_t size = std::filesystem::file_size(file, error);
  std::ifstream stream{file, std::ios::binary};
  if (error || !stream)
    return "cannot be read; check its permissions";
  if (size == 0)
    return "is empty; copy it again";
  if (size % sizeof(KittiPoint) != 0)
    return fmt::format("{} bytes are not whole points of 16; copy it again", size);
  if (size > kMaxCloudPoints * sizeof(KittiPoint))
    return fmt::format("{} points are more than a sweep may have ({})", size / sizeof(KittiPoint), kMaxCloudPoints);
  points.resize(size / sizeof(KittiPoint));
  if (!stream.read(reinterpret_cast<char*>(points.data()), static_cast<std::streamsize>(size)))
    return "cannot be read to its end; copy it again";
  for (KittiPoint& point : points)
    point.reflectance *= kMaxIntensity;
  return std::nullopt;
}

/// Returns consecutive fields.
std::vector<SweepPoints::Field> floats(std::initializer_list<const char*> names) {
  std::vector<SweepPoints::Field> fields;
  for (const char* const name : names)
    fields.push_back({name, static_cast<std::uint32_t>(fields.size() * sizeof(float)), Type::float32});
  return fields;
}

template <class Record> void put(const std::vector<Record>& records, SweepPoints& points) {
  points.width = static_cast<std::uint32_t>(records.size());
  points.height = 1;
  points.point_step = sizeof(Record);
  points.data.resize(records.size() * sizeof(Record));
  if (!records.empty())
    std::memcpy(points.data.data(), records.data(), points.data.size());
}

void put_without_rings(const std::vector<KittiPoint>& records, SweepPoints& points) {
  points.fields = floats({"x", "y", "z", "intensity"});
  put(records, points);
}

} // namespace

CloudView SweepPoints::view(Stamp stamp) const {
  CloudView view;
  view.stamp = stamp;
  view.height = height;
  view.width = width;
  view.point_step = point_step;
  view.row_step = point_step * width;
  for (const Field& field : fields) {
    if (view.field_count < CloudView::kMaxFields)
      view.storage[view.field_count++] = {field.name, field.offset, field.type};
  }
  view.data = data;
  return view;
}

Problem read_bin_points(const std::filesystem::path& file, SweepPoints& points) {
  std::vector<KittiPoint> records;
  Problem problem = read_bin(file, records);
  if (!problem)
    put_without_rings(records, points);
  return problem;
}

Problem read_kitti_sweep(const std::filesystem::path& file, double raised_deg, SweepPoints& points) {
  std::vector<KittiPoint> records;
  if (Problem problem = read_bin(file, records))
    return problem;
  raise(records, raised_deg);
  std::vector<KittiReturn> returns;
  const std::optional<std::size_t> rings = find_returns(records, returns);
  if (!rings) {
    put_without_rings(records, points);
    return std::nullopt;
  }
  std::vector<std::array<float, 5>> with_rings;
  with_rings.reserve(returns.size());
  for (const auto& [p, unused, ring_from_top] : returns)
    with_rings.push_back({p.x_m, p.y_m, p.z_m, p.reflectance, static_cast<float>(*rings - 1 - ring_from_top)});
  points.fields = floats({"x", "y", "z", "intensity", "ring"});
  put(with_rings, points);
  return std::nullopt;
}

} // namespace locus::tools
