// SPDX-License-Identifier: Apache-2.0
#include "locus_experiments/subset_table.hpp"

#include <algorithm>
#include <iterator>
#include <string_view>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "locus_experiments/fault_verdict.hpp"
#include "locus_experiments/harsh_figures.hpp"
#include "locus_replay/quantiles.hpp"

namespace locus::experiments {
namespace {

/// Bound of the law on the error with all sources, times that of the best sound subset.
constexpr double kMostRatio = 1.2;

/// Errors below this are equal: half of the range resolution of a VLP-16.
constexpr double kLeastError_m = 1e-3;

/// Excess over the best subset that the summary counts separately.
constexpr double kMuch_m = 0.01;

double counted_m(const Results& subset) { return std::max(kLeastError_m, subset.at("mean_m").get<double>()); }

Results subset_of(const Results& run) {
  Results subset{{"subset", run.at("subset")}, {"sound", run.at("sound")}};
  if (run.contains("failed")) {
    subset["failed"] = run.at("failed");
    return subset;
  }
  const Results& summary = run.at("summary");
  subset["mean_m"] = summary.at("ape_m").at("mean");
  subset["worst_m"] = summary.at("ape_m").at("max");
  subset["worst_sigma"] = summary.at("covariance").at("worst_sigma");
  subset["tracking"] = run.at("figures").at("tracking");
  subset["good"] = run.at("figures").at("lost_after_s").is_null();
  return subset;
}

/// Appends each odometry source alone, as far as it reported anything.
void add_odometry(const Results& all, Results& subsets) {
  const auto unsound = all.at("unsound").get<std::vector<std::string>>();
  for (const auto& [name, figures] : all.at("figures").at("odometry").items()) {
    if (figures.is_null())
      continue;
    subsets.push_back({{"subset", name + " alone"},
                       {"sound", std::ranges::count(unsound, name) == 0},
                       {"mean_m", figures.at("mean_m")},
                       {"worst_m", figures.at("worst_m")},
                       {"good", figures.at("lost_after_s").is_null()}});
  }
}

/// Returns the sound parts of the sources; the first of `subsets` is all of them.
std::vector<const Results*> sound_parts(const Results& subsets) {
  std::vector<const Results*> parts;
  for (std::size_t i = 1; i < subsets.size(); ++i) {
    if (subsets[i].at("sound").get<bool>() && subsets[i].contains("mean_m"))
      parts.push_back(&subsets[i]);
  }
  return parts;
}

/// Applies the law to a row; `all` is its run with all sources. Precondition: its subsets are there, and "best" and
/// "ratio" with null, because a new key would move the subsets.
void judge_row(const Results& all, Results& row) {
  const Results& subsets = row.at("subsets");
  const std::vector<const Results*> parts = sound_parts(subsets);
  std::vector<std::string> broken;
  if (!parts.empty()) {
    const Results& best = **std::ranges::min_element(parts, {}, [](const Results* part) { return counted_m(*part); });
    const double ratio = counted_m(subsets[0]) / counted_m(best);
    row["best"] = best.at("subset");
    row["ratio"] = ratio;
    if (ratio > kMostRatio)
      broken.push_back(fmt::format("{:.2f} x {}", ratio, best.at("subset").get<std::string>()));
  }
  const bool is_lost = !subsets[0].at("good").get<bool>() &&
                       std::ranges::none_of(parts, [](const Results* part) { return part->at("good").get<bool>(); });
  if (is_lost) {
    const Results& after_s = all.at("figures").at("flagged_after_s");
    if (after_s.is_null() || after_s.get<double>() > kFlaggedWithin_s)
      broken.emplace_back("lost, not flagged");
    if (subsets[0].at("worst_sigma").get<double>() > kMostSigmas)
      broken.push_back(fmt::format("lost by {:.1f} sigma", subsets[0].at("worst_sigma").get<double>()));
  }
  row["verdict"] = !broken.empty() ? "broken" : is_lost ? "flagged" : "holds";
  row["broken"] = broken;
  row["holds"] = broken.empty();
}

/// Builds a row from the runs of one drive and view, all sources first.
Results judged_row(const std::vector<const Results*>& runs) {
  const Results& all = *runs.front();
  Results row{{"drive", all.at("drive")},
              {"view_deg", all.at("view_deg")},
              {"subsets", Results::array()},
              {"best", nullptr},
              {"ratio", nullptr}};
  for (const Results* run : runs)
    row["subsets"].push_back(subset_of(*run));
  if (all.contains("failed")) {
    row.update({{"verdict", "failed"}, {"broken", Results::array({all.at("failed")})}, {"holds", false}});
    return row;
  }
  add_odometry(all, row["subsets"]);
  judge_row(all, row);
  return row;
}

std::string place_of(const Results& row) {
  return fmt::format("{} | {}", row.at("drive").get<std::string>(), row.at("view_deg").get<int>());
}

/// Returns the sigma and the share of `tracking`; empty for odometry alone.
std::string trust_in(const Results& subset) {
  if (!subset.contains("tracking"))
    return " | ";
  return fmt::format("{:.1f} | {:.0f} %", subset.at("worst_sigma").get<double>(),
                     100 * subset.at("tracking").get<double>());
}

std::string law_line(const Results& row) {
  const Results& all = row.at("subsets").front();
  const auto broken = row.at("broken").get<std::vector<std::string>>();
  const auto found = row.at("verdict").get<std::string>();
  const std::string verdict = broken.empty() ? found : fmt::format("**{}**: {}", found, fmt::join(broken, "; "));
  if (!all.contains("mean_m"))
    return fmt::format("| {} | | | | | | | | {} |\n", place_of(row), verdict);
  std::string best = " | | ";
  if (row.at("best").is_string()) {
    const auto part = std::ranges::find_if(
        row.at("subsets"), [&](const Results& subset) { return subset.at("subset") == row.at("best"); });
    best = fmt::format("{} | {} | {:.2f}", row.at("best").get<std::string>(), in_mm(part->at("mean_m")),
                       row.at("ratio").get<double>());
  }
  return fmt::format("| {} | {} | {} | {} | {} | {} |\n", place_of(row), in_mm(all.at("mean_m")),
                     in_mm(all.at("worst_m")), trust_in(all), best, verdict);
}

std::string subset_lines(const Results& row) {
  std::string lines;
  for (const Results& subset : row.at("subsets")) {
    auto name = subset.at("subset").get<std::string>();
    if (row.at("best") == name)
      name.insert(0, "**").append("**");
    if (!subset.at("sound").get<bool>())
      name += " (not sound)";
    const std::string figures =
        subset.contains("failed")
            ? fmt::format("failed: {} | | |", subset.at("failed").get<std::string>())
            : fmt::format("{} | {} | {}", in_mm(subset.at("mean_m")), in_mm(subset.at("worst_m")), trust_in(subset));
    lines += fmt::format("| {} | {} | {} |\n", place_of(row), name, figures);
  }
  return lines;
}

std::string subsets_command(const Results& results) {
  const Results& subsets = results.at("subsets");
  std::string command = "locus-experiments --subsets";
  if (subsets.at("starts") > 1)
    command += fmt::format(" --starts {}", subsets.at("starts").get<int>());
  if (!results.at("simulated").get<bool>())
    return fmt::format("{} {}", command, fmt::join(subsets.at("places").get<std::vector<std::string>>(), " "));
  if (const auto only = subsets.at("only").get<std::string>(); !only.empty())
    command += fmt::format(" --only \"{}\"", only);
  return fmt::format("{} --duration {} --seeds {}", command, results.at("duration_s").get<int>(),
                     subsets.at("seeds").get<int>());
}

/// Returns the excess of the error with all sources over that of the best subset.
double beyond_best_m(const Results& row) {
  return row.at("ratio").is_null() ? 0.0
                                   : counted_m(row.at("subsets").front()) * (1 - 1 / row.at("ratio").get<double>());
}

std::string summary_of(const Results& rows) {
  const auto count = [&](const auto& which) { return std::ranges::count_if(rows, which); };
  const auto with = [&](std::string_view verdict) {
    return count([&](const Results& row) { return row.at("verdict") == verdict; });
  };
  const auto by_much = count([](const Results& row) {
    return row.at("verdict") == "broken" && (beyond_best_m(row) > kMuch_m || row.at("ratio") <= kMostRatio);
  });
  std::string text = fmt::format(
      "Of {} drives and views, {} hold, {} are flagged in time and within their covariance, {} are broken ({} of them "
      "by more than a centimetre, or lost and not flagged), {} failed.",
      rows.size(), with("holds"), with("flagged"), with("broken"), by_much, with("failed"));
  std::vector<double> ratios;
  const Results* worst = nullptr;
  for (const Results& row : rows) {
    if (row.at("ratio").is_null())
      continue;
    ratios.push_back(row.at("ratio"));
    if (worst == nullptr || row.at("ratio") > worst->at("ratio"))
      worst = &row;
  }
  if (worst != nullptr)
    text += fmt::format(" Error with all sources over that of the best sound subset: median {:.2f}, worst {:.2f} ({}, "
                        "{} degrees, {}).",
                        tools::Quantiles(ratios).median(), worst->at("ratio").get<double>(),
                        worst->at("drive").get<std::string>(), worst->at("view_deg").get<int>(),
                        worst->at("best").get<std::string>());
  return text;
}

} // namespace

void judge_subsets(Results& results) {
  std::vector<std::vector<const Results*>> drives;
  for (const Results& run : results.at("runs")) {
    const auto belongs = [&](const std::vector<const Results*>& drive) {
      return drive.front()->at("drive") == run.at("drive") && drive.front()->at("view_deg") == run.at("view_deg");
    };
    const auto found = std::ranges::find_if(drives, belongs);
    if (found == drives.end())
      drives.push_back({&run});
    else
      found->push_back(&run);
  }
  Results rows = Results::array();
  std::ranges::transform(drives, std::back_inserter(rows), judged_row);
  results["subsets"]["rows"] = std::move(rows);
}

std::string subset_table(const Results& results) {
  const Results& subsets = results.at("subsets");
  const Results& rows = subsets.at("rows");
  std::string text =
      fmt::format("`{}`, version {}, {}. {}\n\n", subsets_command(results), results.at("version").get<std::string>(),
                  machines_of(results.at("runs")), summary_of(rows));
  const auto without_truth = subsets.value("without_truth", std::vector<std::string>{});
  if (!without_truth.empty())
    text += fmt::format("Skipped, because they have no truth: {}.\n\n", fmt::join(without_truth, ", "));
  text +=
      "| drive | view, deg | all, mean error, mm | worst, mm | worst sigma | tracking | best sound subset | its mean "
      "error, mm | ratio | verdict |\n|---|---:|---:|---:|---:|---:|---|---:|---:|---|\n";
  for (const Results& row : rows)
    text += law_line(row);
  text += "\n| drive | view, deg | subset | mean error, mm | worst, mm | worst sigma | tracking |\n"
          "|---|---:|---|---:|---:|---:|---:|\n";
  for (const Results& row : rows)
    text += subset_lines(row);
  return text;
}

} // namespace locus::experiments
