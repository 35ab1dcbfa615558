// SPDX-License-Identifier: Apache-2.0
#include "locus_experiments/fault_figures.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <fstream>
#include <string>
#include <string_view>
#include <vector>

#include <fmt/format.h>

#include "accuracy/pose_pairs.hpp"
#include "accuracy/trajectory_accuracy.hpp"
#include "locus_replay/failure.hpp"

namespace locus::experiments {
namespace {

using nlohmann::ordered_json;
using tools::ExitStatus;
using tools::Failure;
using tools::value_or_fail;

/// A row of odometry.csv, as far as it is of use here.
struct Row {
  std::string state;
  std::array<double, 2> variance_m2{}; ///< along x and y of odom
};

constexpr std::size_t kStateColumn = 1;
constexpr std::array<std::size_t, 2> kVarianceColumns{5, 12}; // the diagonal of a matrix of 6 x 6 from column 5 on

std::vector<std::string_view> columns_of(std::string_view line) {
  std::vector<std::string_view> columns;
  for (std::size_t begin = 0; begin <= line.size();) {
    const std::size_t end = std::min(line.find(',', begin), line.size());
    columns.push_back(line.substr(begin, end - begin));
    begin = end + 1;
  }
  return columns;
}

std::vector<Row> read_rows(const std::filesystem::path& file) {
  std::ifstream stream{file};
  std::vector<Row> rows;
  std::string line;
  std::getline(stream, line); // header
  while (std::getline(stream, line)) {
    const std::vector<std::string_view> columns = columns_of(line);
    if (columns.size() <= kVarianceColumns.back())
      throw Failure(ExitStatus::failed,
                    fmt::format("{}:{}: ends too early; run again", file.string(), rows.size() + 2));
    Row row{.state = std::string(columns[kStateColumn])};
    for (std::size_t axis = 0; axis < row.variance_m2.size(); ++axis) {
      const std::string_view text = columns[kVarianceColumns[axis]];
      std::from_chars(text.data(), text.data() + text.size(), row.variance_m2[axis]);
    }
    rows.push_back(std::move(row));
  }
  return rows;
}

double share_told(std::span<const Row> rows) {
  const auto told = std::ranges::count_if(
      rows, [](const Row& row) { return row.state == "degenerate" || row.state == "dead_reckoning"; });
  return static_cast<double>(told) / std::max(1.0, static_cast<double>(rows.size()));
}

ordered_json growth(const std::vector<Row>& rows, std::span<const StampedPose> estimates) {
  constexpr double kBegun_m = 5;
  const auto away_m = [&](const StampedPose& pose) {
    return (pose.T_source_base.translation - estimates.front().T_source_base.translation).norm();
  };
  const auto begun = std::ranges::find_if(estimates, [&](const StampedPose& pose) { return away_m(pose) >= kBegun_m; });
  const auto farthest = std::ranges::max_element(estimates, {}, away_m);
  if (begun == estimates.end())
    return nullptr;
  const Row& first = rows[static_cast<std::size_t>(begun - estimates.begin())];
  const Row& last = rows[static_cast<std::size_t>(farthest - estimates.begin())];
  return {{"x", last.variance_m2[0] / first.variance_m2[0]}, {"y", last.variance_m2[1] / first.variance_m2[1]}};
}

} // namespace

double error_added_m(std::span<const StampedPose> estimates, std::span<const StampedPose> truth,
                     const Interval& interval) {
  const std::vector<PosePair> pairs = paired(estimates, truth);
  const Stamp from = truth.front().stamp + from_seconds(interval.from_s);
  const Stamp until = truth.front().stamp + from_seconds(interval.until_s);
  const auto last_until = [&](Stamp stamp) {
    return std::ranges::upper_bound(pairs, stamp, {}, &PosePair::stamp) - pairs.begin() - 1;
  };
  const auto first = last_until(from), last = last_until(until);
  if (first < 0)
    return 0.0;
  const PosePair &begin = pairs[static_cast<std::size_t>(first)], &end = pairs[static_cast<std::size_t>(last)];
  const Pose T_odom = begin.T_odom_base.inverse() * end.T_odom_base;
  const Pose T_truth = begin.T_truth_base.inverse() * end.T_truth_base;
  return (T_odom.translation - T_truth.translation).norm();
}

ordered_json fault_figures(const Interval& interval, const std::filesystem::path& run_folder,
                           const CaptureFolder& capture) {
  const auto read = [](const std::filesystem::path& file) {
    return value_or_fail(read_trajectory(file), ExitStatus::failed);
  };
  const std::vector<StampedPose> estimates = read(run_folder / "odometry.tum"), truth = read(capture.ground_truth);
  const std::vector<Row> rows = read_rows(run_folder / "odometry.csv");
  if (rows.size() != estimates.size())
    throw Failure(ExitStatus::failed,
                  fmt::format("{}: odometry.tum and odometry.csv differ in length; run again", run_folder.string()));
  const Stamp from = truth.front().stamp + from_seconds(interval.from_s);
  const auto before = std::ranges::lower_bound(estimates, from, {}, &StampedPose::stamp) - estimates.begin();
  ordered_json figures{{"added_m", error_added_m(estimates, truth, interval)},
                       {"told", share_told(std::span{rows}.subspan(static_cast<std::size_t>(before)))},
                       {"growth", growth(rows, estimates)},
                       {"sources", ordered_json::object()}};
  for (const CaptureFolder::Source& source : capture.odometry) {
    const std::vector<StampedPose> poses = read(source.file);
    const auto accuracy = trajectory_accuracy(poses, truth);
    figures["sources"][source.name] = {{"added_m", error_added_m(poses, truth, interval)},
                                       {"ape_mean_m", accuracy ? accuracy->ape_m.mean : 0.0}};
  }
  return figures;
}

} // namespace locus::experiments
