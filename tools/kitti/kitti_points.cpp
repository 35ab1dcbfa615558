// SPDX-License-Identifier: Apache-2.0
#include "kitti/kitti_points.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <fstream>
#include <string>
#include <system_error>

#include "core/base/pose.hpp"

namespace locus::tools {
namespace {

constexpr std::size_t kNumbersOfPoint = 4;

bool read_text(const std::string& text, std::vector<KittiPoint>& points) {
  std::array<float, kNumbersOfPoint> numbers{};
  std::size_t count = 0;
  const char* at = text.data();
  const char* const end = at + text.size();
  const auto is_blank = [](char c) { return c == ' ' || c == '\t' || c == '\r' || c == '\n'; };
  while ((at = std::find_if_not(at, end, is_blank)) != end) {
    const auto [rest, error] = std::from_chars(at, end, numbers[count]);
    if (error != std::errc{} || (rest != end && !is_blank(*rest)))
      return false;
    at = rest;
    count = (count + 1) % kNumbersOfPoint;
    if (count == 0)
      points.push_back({numbers[0], numbers[1], numbers[2], numbers[3]});
  }
  return count == 0 && !points.empty() && points.size() <= kMaxKittiPoints;
}

} // namespace

void raise(std::vector<KittiPoint>& points, double angle_deg) {
  const double cosine = std::cos(angle_deg * kRadPerDeg), sine = std::sin(angle_deg * kRadPerDeg);
  for (KittiPoint& point : points) {
    const auto x_m = static_cast<double>(point.x_m), y_m = static_cast<double>(point.y_m),
               z_m = static_cast<double>(point.z_m);
    const double level_m = std::hypot(x_m, y_m);
    if (!(level_m > 0))
      continue;
    const double stretch = (level_m * cosine - z_m * sine) / level_m;
    point.x_m = static_cast<float>(x_m * stretch);
    point.y_m = static_cast<float>(y_m * stretch);
    point.z_m = static_cast<float>(level_m * sine + z_m * cosine);
  }
}

bool read_kitti_points(const std::filesystem::path& file, std::vector<KittiPoint>& points) {
  constexpr std::uintmax_t kMostText_bytes = kMaxKittiPoints * kNumbersOfPoint * 16;
  points.clear();
  std::error_code error;
  const std::uintmax_t size = std::filesystem::file_size(file, error);
  std::ifstream stream{file, std::ios::binary};
  if (!stream || error || size == 0)
    return false;
  if (file.extension() == ".txt") {
    std::string text(std::min(size, kMostText_bytes), '\0');
    return size <= kMostText_bytes && stream.read(text.data(), static_cast<std::streamsize>(size)) &&
           read_text(text, points);
  }
  if (size % sizeof(KittiPoint) != 0 || size > kMaxKittiPoints * sizeof(KittiPoint))
    return false;
  points.resize(size / sizeof(KittiPoint));
  return bool(stream.read(reinterpret_cast<char*>(points.data()), static_cast<std::streamsize>(size)));
}

} // namespace locus::tools
