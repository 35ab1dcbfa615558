// SPDX-License-Identifier: Apache-2.0
#include "locus_experiments/harsh_table.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <map>
#include <optional>
#include <vector>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "locus_experiments/fault_verdict.hpp"
#include "locus_experiments/harsh_figures.hpp"
#include "locus_experiments/harsh_plan.hpp"
#include "locus_replay/quantiles.hpp"

namespace locus::experiments {
namespace {

using Drives = std::vector<const Results*>;

/// Criteria for every row, beside kMostSigmas and kFlaggedWithin_s: no reported speed more than 1 m/s above the robot's
/// largest.
constexpr double kLeastNees = 3, kMostNees = 12, kMostTooFast_mps = 1;

/// Limits on the error with these sensors: the median over the drives of the mean, and the largest of all.
struct Asked {
  double median_m, worst_m;
};
Asked asked_with(const std::string& sensors) {
  if (sensors == name_of(Sensors::all))
    return {0.025, 0.15};
  return {sensors == name_of(Sensors::lidar_and_imu) ? 0.05 : 0.06, 0.3};
}

template <class Figure> std::vector<double> figures(const Drives& drives, const Figure& figure) {
  std::vector<double> values;
  std::ranges::transform(drives, std::back_inserter(values),
                         [&](const Results* drive) -> double { return figure(*drive); });
  return values;
}
template <class Figure> double largest(const Drives& drives, const Figure& figure) {
  return tools::Quantiles(figures(drives, figure)).at(1.0);
}

Results median_nees(const Drives& drives) {
  std::vector<double> values;
  for (const Results* drive : drives) {
    if (const Results& nees = drive->at("summary").at("covariance").at("nees_10m"); nees.is_number())
      values.push_back(nees);
  }
  return values.empty() ? Results(nullptr) : Results(tools::Quantiles(values).median());
}

void add_losses(const Drives& drives, Results& row) {
  int lost = 0, flagged = 0;
  double after_s = 0;
  for (const Results* drive : drives) {
    const Results& figures = drive->at("harsh");
    lost += figures.at("lost_after_s").is_null() ? 0 : 1;
    if (figures.at("flagged_after_s").is_null())
      continue;
    ++flagged;
    after_s = std::max(after_s, figures.at("flagged_after_s").get<double>());
  }
  row["lost"] = lost;
  row["flagged"] = flagged;
  row["flagged_after_s"] = flagged > 0 ? Results(after_s) : Results(nullptr);
}

Results messages_in(const Drives& drives) {
  std::map<std::string, int> counts;
  for (const Results* drive : drives) {
    for (const Results& line : drive->at("harsh").at("said"))
      ++counts[line.get<std::string>()];
  }
  Results messages = Results::array();
  for (const auto& [text, count] : counts)
    messages.push_back({{"text", text}, {"drives", count}});
  return messages;
}

std::vector<std::string> broken_in(const Results& row, bool accuracy_is_asked) {
  std::vector<std::string> broken;
  const auto expect = [&](bool good, const char* what) {
    if (!good)
      broken.emplace_back(what);
  };
  const Asked asked = asked_with(row.at("sensors"));
  expect(row.at("failed") == 0, "drives fail");
  if (accuracy_is_asked) {
    expect(row.at("median_m").get<double>() <= asked.median_m, "error");
    expect(row.at("worst_m").get<double>() <= asked.worst_m, "worst error");
  }
  expect(row.at("worst_sigma").get<double>() <= kMostSigmas, "sigma");
  if (const Results& nees = row.at("nees_10m"); nees.is_number())
    expect(nees.get<double>() >= kLeastNees && nees.get<double>() <= kMostNees, "NEES");
  expect(row.at("claimed_mps").get<double>() <= row.at("true_mps").get<double>() + kMostTooFast_mps, "speed");
  const bool all_flagged =
      row.at("flagged") == row.at("lost") &&
      (row.at("flagged_after_s").is_null() || row.at("flagged_after_s").get<double>() <= kFlaggedWithin_s);
  expect(all_flagged, "lost, not flagged");
  return broken;
}

/// Collects all seeds and starts.
Drives drives_of(const HarshCase& harsh_case, Sensors sensors, const RunsById& runs, int seeds, int& failed) {
  Drives drives;
  for (int seed = 1; seed <= seeds; ++seed) {
    for (int start = 0; start < kHarshStarts; ++start) {
      const Results* run = find(runs, harsh_case.course_name(seed), harsh_configuration(sensors, start));
      if (run != nullptr && run->contains("failed"))
        ++failed;
      else if (run != nullptr)
        drives.push_back(run);
    }
  }
  return drives;
}

/// Returns nothing if none of its runs is among these.
std::optional<Results> row_of(const HarshCase& harsh_case, Sensors sensors, const RunsById& runs, int seeds) {
  int failed = 0;
  const Drives drives = drives_of(harsh_case, sensors, runs, seeds, failed);
  if (drives.empty() && failed == 0)
    return std::nullopt;
  Results row{{"course", harsh_case.course},
              {"imperfection", harsh_case.imperfection},
              {"sensors", name_of(sensors)},
              {"drives", drives.size()},
              {"failed", failed}};
  if (drives.empty()) {
    row["broken"] = {"drives fail"};
    row["holds"] = false;
    return row;
  }
  const auto harsh = [](const char* key) { return [key](const Results& run) { return run.at("harsh").at(key); }; };
  const auto ape = [](const char* key) {
    return [key](const Results& run) { return run.at("summary").at("ape_m").at(key); };
  };
  row["standing"] =
      std::ranges::count_if(drives, [](const Results* run) { return run->at("harsh").at("standing").get<bool>(); });
  row["median_m"] = tools::Quantiles(figures(drives, ape("mean"))).median();
  row["worst_m"] = largest(drives, ape("max"));
  row["worst_sigma"] =
      largest(drives, [](const Results& run) { return run.at("summary").at("covariance").at("worst_sigma"); });
  row["nees_10m"] = median_nees(drives);
  row["claimed_mps"] = largest(drives, [](const Results& run) { return run.at("summary").at("largest_speed_mps"); });
  row["true_mps"] = largest(drives, harsh("true_mps"));
  add_losses(drives, row);
  row["said"] = messages_in(drives);
  const bool tells_nothing_along = harsh_case.bare && sensors != Sensors::all;
  row["broken"] = broken_in(row, !tells_nothing_along);
  row["holds"] = row["broken"].empty();
  return row;
}

std::string messages_in_words(const Results& messages) {
  constexpr std::size_t kLongest = 90;
  std::vector<std::string> texts;
  for (const Results& line : messages) {
    auto text = line.at("text").get<std::string>();
    if (text.size() > kLongest)
      text = text.substr(0, text.rfind(' ', kLongest)) + " ...";
    texts.push_back(fmt::format("{} ({} x)", text, line.at("drives").get<int>()));
  }
  return fmt::format("{}", fmt::join(texts, "; "));
}

std::string lost_in_words(const Results& row) {
  const int lost = row.at("lost"), flagged = row.at("flagged");
  if (lost == 0)
    return "";
  const Results& after_s = row.at("flagged_after_s");
  return fmt::format("{}, {}{}", lost, flagged,
                     after_s.is_null() ? "" : fmt::format(" within {:.1f} s", after_s.get<double>()));
}

std::string harsh_line(const Results& row) {
  const auto broken = row.at("broken").get<std::vector<std::string>>();
  const std::string holds = broken.empty() ? "yes" : fmt::format("**no**: {}", fmt::join(broken, ", "));
  const std::string head = fmt::format("| {} | {} | {} ", row.at("course").get<std::string>(),
                                       row.at("imperfection").get<std::string>(), row.at("sensors").get<std::string>());
  if (!row.contains("median_m"))
    return fmt::format("{}| 0 | | | | | | | {} | |\n", head, holds);
  const Results& nees = row.at("nees_10m");
  return fmt::format("{}| {}, {} | {} | {} | {:.1f} | {} | {:.1f}, {:.1f} | {} | {} | {} |\n", head,
                     row.at("drives").get<int>(), row.at("standing").get<int>(), in_mm(row.at("median_m")),
                     in_mm(row.at("worst_m")), row.at("worst_sigma").get<double>(),
                     nees.is_number() ? fmt::format("{:.1f}", nees.get<double>()) : "",
                     row.at("claimed_mps").get<double>(), row.at("true_mps").get<double>(), lost_in_words(row), holds,
                     messages_in_words(row.at("said")));
}

} // namespace

void judge_harsh(Results& results) {
  const RunsById runs = by_id(results.at("runs"));
  Results& harsh = results.at("harsh");
  Results rows = Results::array();
  for (const HarshCase& harsh_case : harsh_cases(harsh.at("only"))) {
    for (const Sensors sensors : harsh_case.sensors()) {
      if (std::optional<Results> row = row_of(harsh_case, sensors, runs, harsh.at("seeds")))
        rows.push_back(std::move(*row));
    }
  }
  harsh["rows"] = std::move(rows);
}

std::string harsh_table(const Results& results) {
  const Results& harsh = results.at("harsh");
  const Results& rows = harsh.at("rows");
  const auto hold = std::ranges::count_if(rows, [](const Results& row) { return row.at("holds").get<bool>(); });
  const std::string only = harsh.at("only").get<std::string>();
  std::string text =
      fmt::format("`locus-experiments --harsh{} --duration {} --seeds {}`, version {}, {}. {} of {} rows "
                  "hold.\n\n",
                  only.empty() ? "" : fmt::format(" --only \"{}\"", only), results.at("duration_s").get<int>(),
                  harsh.at("seeds").get<int>(), results.at("version").get<std::string>(),
                  machines_of(results.at("runs")), hold, rows.size());
  text +=
      "| course | imperfection | sensors | drives, from standstill | mean error, mm | worst, mm | worst sigma | NEES | "
      "estimated, true speed, m/s | lost, flagged | holds | messages "
      "|\n|---|---|---|---|---:|---:|---:|---:|---|---|---|---|\n";
  for (const Results& row : rows)
    text += harsh_line(row);
  return text;
}

} // namespace locus::experiments
