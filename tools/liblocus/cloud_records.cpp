// SPDX-License-Identifier: Apache-2.0
#include "liblocus/cloud_records.hpp"

#include <array>
#include <cstdint>
#include <cstring>
#include <string_view>

#include <fmt/format.h>

namespace locus::library {
namespace {

using Type = CloudView::Type;

struct Record {
  float x_m, y_m, z_m, intensity;
  double time_s;
  std::uint16_t ring;
  std::array<std::uint16_t, 3> zero; ///< for the padding: clouds are compared bytewise
};

void check_length(std::string_view name, std::size_t length, std::size_t points) {
  if (length != 0 && length != points)
    throw liblocus::Error(
        fmt::format("cloud: {} has {} numbers for {} points; pass one for each point, or none", name, length, points));
}

} // namespace

std::size_t points_of(const liblocus::Cloud& cloud) { return cloud.xyz_m.size() / 3; }

void check_lengths(const liblocus::Cloud& cloud) {
  if (cloud.xyz_m.size() % 3 != 0)
    throw liblocus::Error(
        fmt::format("cloud: xyz_m has {} numbers; pass three for each point: x, y, z", cloud.xyz_m.size()));
  check_length("time_s", cloud.time_s.size(), points_of(cloud));
  check_length("ring", cloud.ring.size(), points_of(cloud));
  check_length("intensity", cloud.intensity.size(), points_of(cloud));
}

const CloudView& CloudRecords::make(const liblocus::Cloud& cloud) {
  const std::size_t points = points_of(cloud);
  bytes_.resize(points * sizeof(Record));
  for (std::size_t i = 0; i < points; ++i) {
    const Record record{cloud.xyz_m[3 * i],
                        cloud.xyz_m[3 * i + 1],
                        cloud.xyz_m[3 * i + 2],
                        cloud.intensity.empty() ? 0.0F : cloud.intensity[i],
                        cloud.time_s.empty() ? 0.0 : cloud.time_s[i],
                        cloud.ring.empty() ? std::uint16_t{0} : cloud.ring[i],
                        {}};
    std::memcpy(&bytes_[i * sizeof(Record)], &record, sizeof(Record));
  }
  view_ = {};
  view_.stamp = stamp_from_ns(cloud.stamp_ns);
  view_.height = 1;
  view_.width = static_cast<std::uint32_t>(points);
  view_.point_step = sizeof(Record);
  view_.row_step = view_.width * view_.point_step;
  view_.data = bytes_;
  const auto add = [this](std::string_view name, std::size_t offset, Type type) {
    view_.storage[view_.field_count++] = {name, static_cast<std::uint32_t>(offset), type};
  };
  add("x", offsetof(Record, x_m), Type::float32);
  add("y", offsetof(Record, y_m), Type::float32);
  add("z", offsetof(Record, z_m), Type::float32);
  if (!cloud.intensity.empty())
    add("intensity", offsetof(Record, intensity), Type::float32);
  if (!cloud.time_s.empty())
    add("time", offsetof(Record, time_s), Type::float64);
  if (!cloud.ring.empty())
    add("ring", offsetof(Record, ring), Type::uint16);
  return view_;
}

} // namespace locus::library
