// SPDX-License-Identifier: Apache-2.0
#include "sweep_folder/folder_truth.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <fstream>
#include <optional>
#include <sstream>
#include <string_view>
#include <system_error>

#include <fmt/format.h>

#include "drivers/files/motion_rows.hpp"

namespace locus::tools {
namespace {

/// Parses the numbers in the first columns; false if one is invalid.
bool read_numbers(std::string_view line, std::span<double> numbers) {
  for (double& number : numbers) {
    const std::size_t end = std::min(line.find(','), line.size());
    const std::string_view text = trimmed(line.substr(0, end));
    const auto [stop, error] = std::from_chars(text.data(), text.data() + text.size(), number);
    if (error != std::errc{} || stop != text.data() + text.size() || !std::isfinite(number))
      return false;
    line.remove_prefix(std::min(end + 1, line.size()));
  }
  return true;
}

/// Reads the upper three rows of a matrix.
std::optional<Pose> read_matrix(std::istream& stream) {
  constexpr double kRounding = 1e-3;
  Eigen::Matrix<double, 3, 4, Eigen::RowMajor> rows;
  for (double& number : rows.reshaped<Eigen::RowMajor>()) {
    if (!(stream >> number))
      return std::nullopt;
  }
  const Eigen::Matrix3d R = rows.leftCols<3>();
  if (!R.isUnitary(kRounding) || R.determinant() < 0)
    return std::nullopt;
  return Pose{Eigen::Quaterniond(R).normalized(), rows.col(3)};
}

std::optional<Pose> read_calibration(const std::filesystem::path& file) {
  std::ifstream stream{file};
  for (std::string line; std::getline(stream, line);) {
    std::istringstream words{line};
    std::string key;
    if (words >> key && (key == "Tr:" || key == "Tr_velo_to_cam:"))
      return read_matrix(words);
  }
  return std::nullopt;
}

} // namespace

Expected<std::vector<StampedPose>, std::string> read_euroc_truth(const std::filesystem::path& file) {
  constexpr int kNanoseconds = -9;
  constexpr double kRounding = 0.05;
  std::ifstream stream{file};
  if (!stream)
    return fmt::format("{}: cannot be read; check its permissions", file.string());
  std::vector<StampedPose> poses;
  std::size_t number = 0;
  for (std::string buffer; std::getline(stream, buffer);) {
    ++number;
    const std::string_view line = trimmed(buffer);
    std::array<double, 8> v{}; // time, position, quaternion
    const auto stamp = parse_time(trimmed(line.substr(0, line.find(','))), kNanoseconds);
    if (line.empty() || line.starts_with('#') || (poses.empty() && !stamp))
      continue;
    const bool is_row = stamp && read_numbers(line, v);
    const Eigen::Quaterniond q{v[4], v[5], v[6], v[7]};
    if (!is_row || std::abs(q.norm() - 1.0) > kRounding || (!poses.empty() && *stamp <= poses.back().stamp))
      return fmt::format(
          "{}:{}: not a pose later than the one before, t_ns,x,y,z,qw,qx,qy,qz; correct or remove the line",
          file.string(), number);
    poses.push_back({*stamp, {q.normalized(), {v[1], v[2], v[3]}}});
  }
  return poses;
}

Expected<std::vector<StampedPose>, std::string> read_kitti_truth(const std::filesystem::path& sequence,
                                                                 std::span<const Stamp> stamps) {
  const std::filesystem::path whole = std::filesystem::absolute(sequence / "").lexically_normal().parent_path();
  const std::filesystem::path file = whole.parent_path().parent_path() / "poses" / (whole.filename().string() + ".txt");
  std::error_code ignored;
  if (!std::filesystem::is_regular_file(file, ignored))
    return std::vector<StampedPose>{};
  const std::optional<Pose> T_camera_lidar = read_calibration(whole / "calib.txt");
  if (!T_camera_lidar)
    return fmt::format(
        "{}: has no row \"Tr:\" with the 12 numbers of T_camera_lidar, which the true poses need; copy it "
        "again",
        (whole / "calib.txt").string());
  std::ifstream stream{file};
  std::vector<StampedPose> poses;
  for (std::string line; std::getline(stream, line) && poses.size() <= stamps.size();) {
    std::istringstream words{line};
    const std::optional<Pose> T_world_camera = read_matrix(words);
    if (!T_world_camera)
      return fmt::format("{}:{}: not the 12 numbers of a pose; copy it again", file.string(), poses.size() + 1);
    const Stamp stamp = poses.size() < stamps.size() ? stamps[poses.size()] : Stamp{};
    poses.push_back({stamp, T_camera_lidar->inverse() * *T_world_camera * *T_camera_lidar});
  }
  if (poses.size() != stamps.size())
    return fmt::format("{}: other than {} poses, one for each sweep; copy the data set again", file.string(),
                       stamps.size());
  return poses;
}

} // namespace locus::tools
