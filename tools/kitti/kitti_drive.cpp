// SPDX-License-Identifier: Apache-2.0
#include "kitti/kitti_drive.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <numbers>
#include <system_error>

#include <fmt/format.h>

namespace locus::tools {
namespace {

using std::filesystem::path;
using Problem = std::optional<std::string>;

/// Parses "2011-09-26 13:02:25.964389445".
std::optional<Stamp> parse_time(const std::string& text) {
  int year = 0, month = 0, day = 0, hour = 0, minute = 0, length = 0;
  double second = 0;
  // NOLINTNEXTLINE(cert-err34-c): the ranges are checked below
  if (std::sscanf(text.c_str(), "%4d-%2d-%2d %2d:%2d:%n", &year, &month, &day, &hour, &minute, &length) != 5 ||
      length == 0)
    return std::nullopt;
  const std::string seconds = text.substr(static_cast<std::size_t>(length));
  std::size_t used = 0;
  try {
    second = std::stod(seconds, &used);
  } catch (const std::exception&) {
    return std::nullopt;
  }
  const std::chrono::year_month_day date{std::chrono::year{year}, std::chrono::month{static_cast<unsigned>(month)},
                                         std::chrono::day{static_cast<unsigned>(day)}};
  if (!date.ok() || year < 1970 || year > 2090 || hour < 0 || hour > 23 || minute < 0 || minute > 59 ||
      !(second >= 0 && second < 61))
    return std::nullopt;
  const Duration since_epoch = std::chrono::sys_days{date}.time_since_epoch() + std::chrono::hours{hour} +
                               std::chrono::minutes{minute} + from_seconds(second);
  return Stamp{since_epoch};
}

/// Reads the times by file number; the line of a missing file is blank.
Expected<std::vector<std::optional<Stamp>>, std::string> read_times(const path& file) {
  std::ifstream stream{file};
  if (!stream)
    return fmt::format("{}: cannot be read; a drive needs it, copy the whole folder", file.string());
  std::vector<std::optional<Stamp>> times;
  for (std::string line; std::getline(stream, line);) {
    const bool is_blank = line.find_first_not_of(" \t\r") == std::string::npos;
    const std::optional<Stamp> time = parse_time(line);
    if (!time && !is_blank)
      return fmt::format("{}:{}: not a time like 2011-09-26 13:02:25.964389445; copy the file again", file.string(),
                         times.size() + 1);
    times.push_back(time);
  }
  return times;
}

/// Returns the path of the file with this number in a data folder.
path numbered(const path& folder, std::size_t number, const char* extension) {
  return folder / fmt::format("{:010}{}", number, extension);
}

bool has(const path& file) {
  std::error_code ignored;
  return std::filesystem::exists(file, ignored);
}

/// Returns the points of a sweep, of a drive that is synchronised or one that is not.
std::optional<path> points_of(const path& folder, std::size_t sweep) {
  for (const char* const extension : {".bin", ".txt"}) {
    if (const path file = numbered(folder, sweep, extension); has(file))
      return file;
  }
  return std::nullopt;
}

Problem read_sweeps(const path& folder, KittiDrive& drive) {
  constexpr Duration kShortest = std::chrono::milliseconds{40}, kLongest = std::chrono::milliseconds{250};
  const auto starts = read_times(folder / "timestamps_start.txt"), ends = read_times(folder / "timestamps_end.txt");
  if (!starts || !ends)
    return starts ? ends.error() : starts.error();
  std::size_t missing = 0, odd = 0;
  for (std::size_t i = 0; i < std::min(starts->size(), ends->size()); ++i) {
    const std::optional<Stamp> start = (*starts)[i], end = (*ends)[i];
    const std::optional<path> file = points_of(folder / "data", i);
    const bool in_order = drive.sweeps.empty() || start > drive.sweeps.back().start;
    if (!start || !end || !file)
      missing += start || end || file ? 1U : 0U;
    else if (*end - *start < kShortest || *end - *start > kLongest || !in_order)
      ++odd;
    else
      drive.sweeps.push_back({*file, *start, *end});
  }
  if (drive.sweeps.empty())
    return fmt::format("{}: no sweep that has points (data/0000000000.bin or .txt) and a time; copy the whole drive",
                       folder.string());
  if (missing > 0)
    drive.warnings.push_back(
        fmt::format("{}: {} sweeps lack their points in data or their time and are skipped", folder.string(), missing));
  if (odd > 0)
    drive.warnings.push_back(
        fmt::format("{}: {} sweeps were skipped: their times are out of order or not a revolution of 40 to 250 "
                    "ms",
                    folder.string(), odd));
  return std::nullopt;
}

/// Used fields of an oxts record.
struct Oxts {
  double lat_deg, lon_deg, alt_m;
  Eigen::Vector3d rpy_rad, specific_force_mps2, angular_velocity_radps;
};

std::optional<Oxts> read_oxts(const path& file) {
  enum Place : std::size_t {
    kAttitude = 3,
    kAcceleration = 11,
    kRate = 17,
    kNumbers = 20
  }; // order of the fields in dataformat.txt
  std::ifstream stream{file};
  std::array<double, kNumbers> v{};
  for (double& value : v) {
    if (!(stream >> value))
      return std::nullopt;
  }
  return Oxts{
      v[0], v[1], v[2], Eigen::Vector3d(&v[kAttitude]), Eigen::Vector3d(&v[kAcceleration]), Eigen::Vector3d(&v[kRate])};
}

/// Returns metres east, north and up, by the Mercator projection at the latitude of the first record.
Eigen::Vector3d position_of(const Oxts& oxts, double first_lat_deg) {
  constexpr double kEarth_m = 6378137.0, kRadPerDeg = std::numbers::pi / 180.0;
  const double scale_m = kEarth_m * std::cos(first_lat_deg * kRadPerDeg);
  return {scale_m * oxts.lon_deg * kRadPerDeg, scale_m * std::log(std::tan((90.0 + oxts.lat_deg) * kRadPerDeg / 2.0)),
          oxts.alt_m};
}

/// Reads T_lidar_unit from the calibration of the day.
std::optional<Pose> read_calibration(const path& file) {
  std::ifstream stream{file};
  std::optional<Eigen::Matrix3d> R;
  std::optional<Eigen::Vector3d> T;
  for (std::string key; stream >> key;) {
    Eigen::Matrix<double, 3, 3, Eigen::RowMajor> rows;
    Eigen::Vector3d column;
    if (key == "R:" && std::all_of(rows.data(), rows.data() + 9, [&](double& v) { return bool(stream >> v); }))
      R = rows;
    else if (key == "T:" && std::all_of(column.data(), column.data() + 3, [&](double& v) { return bool(stream >> v); }))
      T = column;
  }
  if (!R || !T || !R->isUnitary(1e-3))
    return std::nullopt;
  return Pose{Eigen::Quaterniond(*R).normalized(), *T};
}

Problem read_inertial_unit(const path& folder, KittiDrive& drive) {
  const auto times = read_times(folder / "oxts/timestamps.txt");
  if (!times)
    return times.error();
  const path calibration = folder.parent_path() / "calib_imu_to_velo.txt";
  const std::optional<Pose> T_lidar_unit = read_calibration(calibration);
  if (!T_lidar_unit)
    drive.warnings.push_back(fmt::format("{}: cannot be read, so true poses are those of the inertial unit, a metre "
                                         "from the lidar; put the day's calibration beside the drive",
                                         calibration.string()));
  const Pose T_unit_lidar = T_lidar_unit.value_or(Pose{}).inverse();
  const Eigen::Quaterniond R_lidar_unit = T_unit_lidar.rotation.conjugate();
  std::optional<Oxts> first;
  std::size_t unread = 0;
  for (std::size_t i = 0; i < times->size(); ++i) {
    const std::optional<Stamp> time = (*times)[i];
    const path file = numbered(folder / "oxts/data", i, ".txt");
    if (!time && !has(file))
      continue;
    const std::optional<Oxts> oxts = read_oxts(file);
    if (!time || !oxts || (!drive.imu.empty() && *time <= drive.imu.back().stamp)) {
      ++unread;
      continue;
    }
    first = first ? first : oxts;
    const Eigen::Quaterniond attitude = from_rpy_rad(oxts->rpy_rad);
    const Pose T_world_unit{attitude, position_of(*oxts, first->lat_deg) - position_of(*first, first->lat_deg)};
    const Pose T_world_lidar = T_world_unit * T_unit_lidar;
    drive.imu.push_back({*time, *time, R_lidar_unit * oxts->angular_velocity_radps,
                         R_lidar_unit * oxts->specific_force_mps2, T_world_lidar.rotation});
    if (T_world_lidar.finite())
      drive.truth.push_back({*time, T_world_lidar});
  }
  if (unread > 0)
    drive.warnings.push_back(fmt::format("{}: {} records cannot be read or are out of order and are skipped",
                                         (folder / "oxts").string(), unread));
  return std::nullopt;
}

} // namespace

bool KittiDrive::is(const path& folder) {
  std::error_code ignored;
  return std::filesystem::is_directory(folder / "velodyne_points/data", ignored);
}

Expected<KittiDrive, std::string> KittiDrive::open(const path& where) {
  const path folder = std::filesystem::absolute(where / ".").lexically_normal().parent_path(); // ensures a parent
  KittiDrive drive;
  Problem problem = read_sweeps(folder / "velodyne_points", drive);
  if (!problem && has(folder / "oxts"))
    problem = read_inertial_unit(folder, drive);
  if (problem)
    return *std::move(problem);
  return drive;
}

} // namespace locus::tools
