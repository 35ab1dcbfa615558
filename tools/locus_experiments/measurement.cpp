// SPDX-License-Identifier: Apache-2.0
#include "locus_experiments/measurement.hpp"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <span>
#include <vector>

#include <fmt/format.h>

#include "accuracy/trajectory_accuracy.hpp"
#include "drivers/files/capture_folder.hpp"
#include "locus_experiments/accuracy_figures.hpp"
#include "locus_experiments/fault_figures.hpp"
#include "locus_experiments/harsh_figures.hpp"
#include "locus_experiments/job_control.hpp"
#include "locus_experiments/subset_figures.hpp"
#include "locus_replay/failure.hpp"
#include "locus_replay/quantiles.hpp"

namespace locus::experiments {
namespace {

using nlohmann::ordered_json;
using tools::ExitStatus;
using tools::Failure;
using tools::value_or_fail;

constexpr std::size_t kMaxSeriesPoints = 300;

/// Rounds to a tenth of a millimetre: no error here is more precise, and the page stays small.
double rounded(double metres) { return std::round(metres * 1e4) / 1e4; }

/// Returns the largest error of each interval.
ordered_json series(const TrajectoryAccuracy& accuracy) {
  const std::size_t count = accuracy.stamps.size();
  const std::size_t step = count / kMaxSeriesPoints + 1;
  ordered_json t_s = ordered_json::array(), error_m = ordered_json::array();
  for (std::size_t begin = 0; begin < count; begin += step) {
    const auto interval = std::span{accuracy.position_error_m}.subspan(begin, std::min(step, count - begin));
    t_s.push_back(std::round(10 * to_seconds(accuracy.stamps[begin] - accuracy.stamps.front())) / 10);
    error_m.push_back(rounded(std::ranges::max(interval)));
  }
  return {{"t_s", t_s}, {"error_m", error_m}};
}

ordered_json box(const std::vector<double>& errors_m) {
  const tools::Quantiles quantiles(errors_m);
  const auto at = [&](double share) { return rounded(quantiles.at(share)); };
  return {{"p1", at(0.01)}, {"q1", at(0.25)}, {"median", at(0.5)}, {"q3", at(0.75)}, {"p99", at(0.99)}, {"max", at(1)}};
}

void add_errors(const std::filesystem::path& trajectory_file, const std::filesystem::path& truth_file,
                ordered_json& result) {
  const auto estimates = value_or_fail(read_trajectory(trajectory_file), ExitStatus::failed);
  const auto truth = value_or_fail(read_trajectory(truth_file), ExitStatus::failed);
  const std::optional<TrajectoryAccuracy> accuracy = trajectory_accuracy(estimates, truth);
  if (!accuracy)
    throw Failure(ExitStatus::failed,
                  fmt::format("{}: has no time in common with {}", trajectory_file.string(), truth_file.string()));
  result["position_error"] = series(*accuracy);
  result["position_error_quantiles_m"] = box(accuracy->position_error_m);
  result["silent_at_end_s"] = std::max(0.0, to_seconds(truth.back().stamp - estimates.back().stamp));
}

} // namespace

ordered_json read_json(const std::filesystem::path& file) {
  std::ifstream stream{file};
  ordered_json json = ordered_json::parse(stream, nullptr, false);
  if (json.is_discarded())
    throw Failure(ExitStatus::failed, fmt::format("{}: missing or not JSON; run again", file.string()));
  return json;
}

std::string machine_name() {
  std::ifstream stream{"/proc/cpuinfo"};
  std::string model = "unknown processor";
  for (std::string line; std::getline(stream, line);) {
    if (line.starts_with("model name")) {
      model = line.substr(std::min(line.find(": ") + 2, line.size()));
      break;
    }
  }
  return fmt::format("{}, {} cores", model, usable_cpus().size());
}

ordered_json measurement(const Run& run, const std::filesystem::path& folder, const std::filesystem::path& capture) {
  if (run.shows_recording)
    return recording_figures(run.course, folder, capture);
  ordered_json result{
      {"options", run.options}, {"machine", machine_name()}, {"summary", read_json(folder / "summary.json")}};
  if (run.shows_subset) {
    result["figures"] = subset_figures(folder, capture, run.mounting_rad.value_or(0));
    return result;
  }
  const CaptureFolder files = value_or_fail(CaptureFolder::find(capture), ExitStatus::failed);
  if (run.mounting_rad)
    result["harsh"] = harsh_figures(folder, files, result["summary"], *run.mounting_rad);
  else if (!files.ground_truth.empty() && run.paced_cpus == 0)
    add_errors(folder / "odometry.tum", files.ground_truth, result);
  if (run.watched)
    result["fault"] = fault_figures(*run.watched, folder, files);
  return result;
}

} // namespace locus::experiments
