// SPDX-License-Identifier: Apache-2.0
#include "locus_replay/sweep_files.hpp"

#include <array>
#include <cstdint>

#include <fmt/format.h>

#include "daemon/dds/sweep_points.hpp"

namespace locus::tools {
namespace {

using Point = daemon::CloudMessage::Point;
using Type = CloudColumn::Type;

constexpr std::array<CloudColumn, 7> kColumns{
    {{"x"}, {"y"}, {"z"}, {"intensity"}, {"time"}, {"ring", Type::uint16}, {"lidar", Type::uint16}}};
static_assert(sizeof(Point) == 5 * sizeof(float) + 2 * sizeof(std::uint16_t));

const std::filesystem::path& newly_made(const std::filesystem::path& folder) {
  make_folder(folder, "--sweeps");
  return folder;
}

} // namespace

SweepFiles::SweepFiles(const std::filesystem::path& folder, CloudFormat format)
    : folder_(newly_made(folder)), format_(format), times_(folder / "times.txt"), poses_(folder / "poses.txt") {}

void SweepFiles::write(const Sweep& sweep, const Odometry& odometry, const OdometryEstimate& estimate) {
  odometry.correction().apply(sweep.returns, placed_);
  daemon::sweep_points(sweep.returns, placed_, points_);
  write_points(folder_ / fmt::format("{:06}.{}", sweeps_++, to_string(format_)));
  constexpr std::int64_t kPerSecond = 1'000'000'000;
  const std::int64_t ns = to_ns(estimate.stamp);
  times_.print("{}.{:09}\n", ns / kPerSecond, ns % kPerSecond);
  const Eigen::Matrix3d R = estimate.T_odom_base.R();
  const Eigen::Vector3d& t = estimate.T_odom_base.translation;
  for (Eigen::Index row = 0; row < 3; ++row)
    poses_.print("{} {} {} {}{}", R(row, 0), R(row, 1), R(row, 2), t[row], row < 2 ? ' ' : '\n');
}

void SweepFiles::close() {
  times_.close();
  poses_.close();
}

void SweepFiles::write_points(const std::filesystem::path& file) {
  switch (format_) {
  case CloudFormat::pcd:
    return write_pcd(file, kColumns, std::as_bytes(std::span(points_)));
  case CloudFormat::ply:
    return write_ply(file, kColumns, std::as_bytes(std::span(points_)));
  case CloudFormat::bin:
    return write_bin(file);
  }
}

void SweepFiles::write_bin(const std::filesystem::path& path) const {
  constexpr float kMaxIntensity = 255.0F;
  OutputFile file(path);
  for (const Point& point : points_) {
    const std::array numbers{point.x_m, point.y_m, point.z_m, point.intensity / kMaxIntensity};
    file.write(std::as_bytes(std::span(numbers)));
  }
  file.close();
}

} // namespace locus::tools
