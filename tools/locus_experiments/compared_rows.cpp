// SPDX-License-Identifier: Apache-2.0
#include "locus_experiments/compared_rows.hpp"

#include <algorithm>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "locus_experiments/fault_verdict.hpp"
#include "locus_experiments/matrix_plan.hpp"

namespace locus::experiments {
namespace {

/// Changes below a millimetre are insignificant: half of the range resolution of a VLP-16.
constexpr FigureKind kError{"error, mm", 1e3, 1, 1e-3}, kMedianError{"median error, mm", 1e3, 1, 1e-3},
    kWorstError{"worst error, mm", 1e3, 1, 1e-3};
constexpr FigureKind kSigma{"worst sigma", 1, 1, 0.1};
/// Tolerates one failed sweep: a run may end one window earlier than another.
constexpr FigureKind kLost{"sweeps lost", 1, 0, 0}, kFailed{"failed", 1, 0, 1};
constexpr FigureKind kDrivesLost{"drives lost", 1, 0, 0}, kUnsaid{"not flagged", 1, 0, 0};
constexpr FigureKind kTooFast{"speed too high, m/s", 1, 1, 0.1};
/// Factor between the NEES and its ideal value of 6 (six axes): too large and too small covariances count alike.
constexpr FigureKind kNees{"NEES, factor from 6", 1, 2, 0.1};

/// Ratio of the mean error to that of the best subset; up to 1.2 is allowed.
constexpr FigureKind kRatio{"ratio to the best subset", 1, 2, 0.2};

using Pointer = Results::json_pointer;

/// Returns nothing if the value is null or absent.
std::optional<double> number_at(const Results& row, const char* pointer) {
  const Results value = row.value(Pointer(pointer), Results{});
  return value.is_number() ? std::optional(value.get<double>()) : std::nullopt;
}

ComparedRow row_of(std::string name, const Results& row, std::vector<std::optional<double>> figures) {
  const bool asked = row.contains("holds");
  const auto broken = row.value("broken", std::vector<std::string>{});
  return {std::move(name), asked ? std::optional(row.at("holds").get<bool>()) : std::nullopt,
          fmt::format("{}", fmt::join(broken, "; ")), std::move(figures)};
}

ComparedRow consistency_row(const Results& consistency) {
  const double nees = number_at(consistency, "/nees_10m").value_or(0);
  const std::optional<double> off = nees > 0 ? std::optional(std::max(nees / 6, 6 / nees)) : std::nullopt;
  return row_of(fmt::format("covariances, {} runs", consistency.at("runs").get<int>()), consistency,
                {std::nullopt, std::nullopt, std::nullopt, consistency.at("failed").get<double>(), off});
}

std::vector<ComparedRow> fault_rows(const Results& results) {
  std::vector<ComparedRow> rows;
  for (const Results& row : results.at("faults").at("rows"))
    rows.push_back(row_of(row.at("course").get<std::string>() + '/' + row.at("configuration").get<std::string>(), row,
                          {number_at(row, "/ape_mean_m/with"), number_at(row, "/worst_sigma"),
                           number_at(row, "/sweeps/lost"), number_at(row, "/sweeps/failed"), std::nullopt}));
  if (const Results& consistency = results.at("faults").at("consistency"); !consistency.is_null())
    rows.push_back(consistency_row(consistency));
  return rows;
}

/// Uses the figures of the run, because a cell describes its findings in words.
std::vector<ComparedRow> matrix_rows(const Results& results) {
  const RunsById runs = by_id(results.at("runs"));
  std::vector<ComparedRow> rows;
  for (const Results& row : results.at("matrix").at("cells")) {
    if (row.contains("impossible"))
      continue;
    MatrixCell cell;
    cell.input = row.at("input");
    cell.what = row.at("fault");
    cell.from_start = row.at("from_start");
    const Results* const found = find(runs, matrix_course(), cell.configuration());
    const Results run = found != nullptr ? *found : Results::object();
    rows.push_back(
        row_of(fmt::format("{}: {}, {}", cell.input, cell.what, cell.from_start ? "from the start" : "mid-drive"), row,
               {number_at(run, "/summary/ape_m/mean"), number_at(run, "/summary/covariance/worst_sigma"),
                number_at(run, "/summary/sweeps/dropped"), number_at(run, "/summary/sweeps/failed")}));
  }
  return rows;
}

/// Returns by how much the first figure exceeds the second; nothing if either is absent.
std::optional<double> excess(const Results& row, const char* figure, const char* over) {
  const auto value = number_at(row, figure), limit = number_at(row, over);
  return value && limit ? std::optional(std::max(0.0, *value - *limit)) : std::nullopt;
}

std::vector<ComparedRow> harsh_rows(const Results& results) {
  std::vector<ComparedRow> rows;
  for (const Results& row : results.at("harsh").at("rows"))
    rows.push_back(
        row_of(fmt::format("{}, {}, {}", row.at("course").get<std::string>(), row.at("imperfection").get<std::string>(),
                           row.at("sensors").get<std::string>()),
               row,
               {number_at(row, "/median_m"), number_at(row, "/worst_m"), number_at(row, "/worst_sigma"),
                number_at(row, "/lost"), excess(row, "/lost", "/flagged"), excess(row, "/claimed_mps", "/true_mps")}));
  return rows;
}

std::vector<ComparedRow> subset_rows(const Results& results) {
  std::vector<ComparedRow> rows;
  for (const Results& row : results.at("subsets").at("rows"))
    rows.push_back(
        row_of(fmt::format("{}, {} degrees", row.at("drive").get<std::string>(), row.at("view_deg").get<int>()), row,
               {number_at(row, "/subsets/0/mean_m"), number_at(row, "/subsets/0/worst_m"),
                number_at(row, "/subsets/0/worst_sigma"), number_at(row, "/ratio")}));
  return rows;
}

} // namespace

const ComparedTable* table_of(const Results& results) {
  static const std::array tables{
      ComparedTable{"faults", {kError, kSigma, kLost, kFailed, kNees}, fault_rows},
      ComparedTable{"matrix", {kError, kSigma, kLost, kFailed}, matrix_rows},
      ComparedTable{"harsh", {kMedianError, kWorstError, kSigma, kDrivesLost, kUnsaid, kTooFast}, harsh_rows},
      ComparedTable{"subsets", {kError, kWorstError, kSigma, kRatio}, subset_rows}};
  const auto* const found =
      std::ranges::find_if(tables, [&](const ComparedTable& table) { return results.contains(table.key); });
  return found == tables.end() ? nullptr : found;
}

} // namespace locus::experiments
