// SPDX-License-Identifier: Apache-2.0
#include "locus_experiments/odometry_rows.hpp"

#include <algorithm>
#include <charconv>
#include <cstddef>
#include <fstream>
#include <string_view>

#include <fmt/format.h>

#include "locus_replay/failure.hpp"

namespace locus::experiments {
namespace {

using tools::ExitStatus;
using tools::Failure;

constexpr std::size_t kStateColumn = 1;
constexpr std::size_t kCovarianceColumn = 5; // 6 x 6, row by row

std::vector<std::string_view> columns_of(std::string_view line) {
  std::vector<std::string_view> columns;
  for (std::size_t begin = 0; begin <= line.size();) {
    const std::size_t end = std::min(line.find(',', begin), line.size());
    columns.push_back(line.substr(begin, end - begin));
    begin = end + 1;
  }
  return columns;
}

std::vector<OdometryRow> read_rows(const std::filesystem::path& file) {
  std::ifstream stream{file};
  std::vector<OdometryRow> rows;
  std::string line;
  std::getline(stream, line); // header
  while (std::getline(stream, line)) {
    const std::vector<std::string_view> columns = columns_of(line);
    if (columns.size() < kCovarianceColumn + 36)
      throw Failure(ExitStatus::failed,
                    fmt::format("{}:{}: ends too early; run again", file.string(), rows.size() + 2));
    const auto covariance = [&](std::size_t i, std::size_t j) {
      const std::string_view text = columns[kCovarianceColumn + 6 * i + j];
      double value = 0;
      std::from_chars(text.data(), text.data() + text.size(), value);
      return value;
    };
    rows.push_back({std::string(columns[kStateColumn]),
                    Eigen::Matrix2d{{covariance(0, 0), covariance(0, 1)}, {covariance(1, 0), covariance(1, 1)}}});
  }
  return rows;
}

} // namespace

std::vector<StampedPose> read_poses(const std::filesystem::path& file) {
  return tools::value_or_fail(read_trajectory(file), ExitStatus::failed);
}

OdometryRows read_odometry(const std::filesystem::path& run_folder) {
  OdometryRows odometry{read_poses(run_folder / "odometry.tum"), read_rows(run_folder / "odometry.csv")};
  if (odometry.rows.size() != odometry.estimates.size())
    throw Failure(ExitStatus::failed,
                  fmt::format("{}: odometry.tum and odometry.csv differ in length; run again", run_folder.string()));
  return odometry;
}

} // namespace locus::experiments
