// SPDX-License-Identifier: Apache-2.0
#include "locus_experiments/harsh_figures.hpp"

#include <algorithm>
#include <cctype>
#include <fstream>
#include <set>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include <fmt/format.h>

#include "locus_replay/failure.hpp"

namespace locus::experiments {
namespace {

using nlohmann::ordered_json;

/// Returns the largest mean speed between consecutive sweeps.
double largest_speed_mps(std::span<const PosePair> pairs) {
  double largest = 0;
  for (std::size_t i = 1; i < pairs.size(); ++i) {
    const Eigen::Vector3d way_m = pairs[i].T_truth_base.translation - pairs[i - 1].T_truth_base.translation;
    largest = std::max(largest, way_m.norm() / to_seconds(pairs[i].stamp - pairs[i - 1].stamp));
  }
  return largest;
}

bool stands_at_first(std::span<const PosePair> pairs) {
  constexpr double kStill_m = 0.02;
  const Stamp until = pairs.front().stamp + std::chrono::seconds{1};
  return std::ranges::all_of(pairs, [&](const PosePair& pair) {
    return pair.stamp > until ||
           (pair.T_truth_base.translation - pairs.front().T_truth_base.translation).norm() < kStill_m;
  });
}

using PairIterator = std::vector<PosePair>::const_iterator;

PairIterator first_lost(const std::vector<PosePair>& pairs, double mounting_rad) {
  const Pose T_odom_truth = pairs.front().T_odom_base * pairs.front().T_truth_base.inverse();
  const Eigen::Vector3d* last_m = &pairs.front().T_truth_base.translation;
  double way_m = 0;
  return std::ranges::find_if(pairs, [&](const PosePair& pair) {
    way_m += (pair.T_truth_base.translation - *last_m).norm();
    last_m = &pair.T_truth_base.translation;
    const double error_m = (pair.T_odom_base.translation - T_odom_truth * pair.T_truth_base.translation).norm();
    return !(error_m < kLost_m + way_m * mounting_rad);
  });
}

/// Returns the time from `begin`; null at the end of the pairs.
ordered_json seconds_to(PairIterator pair, const std::vector<PosePair>& pairs, PairIterator begin) {
  return pair == pairs.end() ? ordered_json(nullptr) : ordered_json(to_seconds(pair->stamp - begin->stamp));
}

std::string without_numbers(std::string_view line) {
  std::string text;
  for (const char c : line) {
    const bool digit = std::isdigit(static_cast<unsigned char>(c)) != 0;
    if (!digit)
      text += c;
    else if (text.empty() || text.back() != '#')
      text += '#';
    if (text.ends_with("#.#"))
      text.resize(text.size() - 2);
  }
  return text;
}

/// Lists the warnings in the log and the received sources that were taken out of use.
std::vector<std::string> messages_of(const std::filesystem::path& log, const ordered_json& summary) {
  constexpr std::string_view kWarning = "locus-replay: warning: ";
  std::set<std::string> lines;
  std::ifstream stream{log};
  for (std::string line; std::getline(stream, line);) {
    if (line.starts_with(kWarning))
      lines.insert(without_numbers(std::string_view(line).substr(kWarning.size())));
  }
  for (const auto& [name, source] : summary.at("sources").items()) {
    if (source.at("received").get<std::uint64_t>() > 0 && source.at("health_changes").get<int>() > 0)
      lines.insert(name + " was lost");
  }
  return {lines.begin(), lines.end()};
}

} // namespace

ordered_json lost_after_s(const std::vector<PosePair>& pairs, double mounting_rad) {
  return seconds_to(first_lost(pairs, mounting_rad), pairs, pairs.begin());
}

ordered_json loss_figures(const std::vector<PosePair>& pairs, std::span<const OdometryRow> rows, double mounting_rad) {
  const auto lost = first_lost(pairs, mounting_rad);
  const auto flagged =
      std::find_if(lost, pairs.end(), [&](const PosePair& pair) { return rows[pair.estimate].flagged(); });
  return {{"lost_after_s", seconds_to(lost, pairs, pairs.begin())},
          {"flagged_after_s", seconds_to(flagged, pairs, lost)}};
}

ordered_json harsh_figures(const std::filesystem::path& run_folder, const CaptureFolder& capture,
                           const ordered_json& summary, double mounting_rad) {
  const auto [estimates, rows] = read_odometry(run_folder);
  const std::vector<StampedPose> truth = read_poses(capture.ground_truth);
  const std::vector<PosePair> pairs = paired(estimates, truth);
  if (pairs.empty())
    throw tools::Failure(
        tools::ExitStatus::failed,
        fmt::format("{}: has no estimate within the time of the truth; run again", run_folder.string()));
  ordered_json figures{{"standing", stands_at_first(pairs)}, {"true_mps", largest_speed_mps(pairs)}};
  figures.update(loss_figures(pairs, rows, mounting_rad));
  figures["said"] = messages_of(run_folder / "log", summary);
  return figures;
}

} // namespace locus::experiments
