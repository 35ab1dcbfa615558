// SPDX-License-Identifier: Apache-2.0
#include "locus_experiments/compare.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <tuple>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "locus_experiments/compared_rows.hpp"
#include "locus_experiments/fault_verdict.hpp"
#include "locus_replay/failure.hpp"
#include "locus_replay/output_file.hpp"

namespace locus::experiments {
namespace {

using tools::ExitStatus;
using tools::Failure;

/// Relative difference below which figures count as equal: half of what the tables allow a fault to add.
constexpr double kSameShare = 0.1;

/// Verdict, sorted worst first.
enum class Change : std::uint8_t { worse, same, better };

struct RowChange {
  const ComparedRow *before, *after;
  Change change;
  bool holding_changes;
  double gain; ///< log(before / after) of the worst figure, or of the best one if the row is better
  bool equal;  ///< in all figures
};

/// Returns a positive value if the figure became smaller.
double gain_of(const FigureKind& kind, const std::optional<double>& before, const std::optional<double>& after) {
  if (!before || !after) // a run without a figure is worse than any
    return (after ? HUGE_VAL : 0.0) - (before ? HUGE_VAL : 0.0);
  if (std::abs(*after - *before) <= std::max(kind.negligible, kSameShare * *before))
    return 0.0;
  const double least = std::max(kind.negligible, 1e-9); // keeps a change from zero finite
  return std::log((*before + least) / (*after + least));
}

RowChange change_of(const std::vector<FigureKind>& kinds, const ComparedRow& before, const ComparedRow& after) {
  double worst = 0, best = 0;
  for (std::size_t i = 0; i < kinds.size(); ++i) {
    const double gain = gain_of(kinds[i], before.figures[i], after.figures[i]);
    worst = std::min(worst, gain);
    best = std::max(best, gain);
  }
  const bool held = before.holds.value_or(true), holds = after.holds.value_or(true);
  const Change by_figures = worst < 0 ? Change::worse : best > 0 ? Change::better : Change::same;
  const Change change = held == holds ? by_figures : held ? Change::worse : Change::better;
  return {&before,
          &after,
          change,
          held != holds,
          change == Change::better ? best : worst,
          held == holds && before.figures == after.figures};
}

/// Sort key: rows that no longer hold come first, rows that newly hold last.
auto place_of(const RowChange& row) {
  const int first = row.change == Change::worse && row.holding_changes ? 0 : 1;
  const int last = row.change == Change::better && row.holding_changes ? 1 : 0;
  return std::tuple(static_cast<int>(row.change), first, last, row.gain);
}

const ComparedRow* row_named(const std::vector<ComparedRow>& rows, const std::string& name) {
  const auto found = std::ranges::find(rows, name, &ComparedRow::name);
  return found == rows.end() ? nullptr : &*found;
}

/// Compares the rows present in both, sorted worst first.
std::vector<RowChange> changes_between(const ComparedTable& table, const std::vector<ComparedRow>& before,
                                       const std::vector<ComparedRow>& after) {
  std::vector<RowChange> changes;
  for (const ComparedRow& row : after) {
    if (const ComparedRow* was = row_named(before, row.name))
      changes.push_back(change_of(table.kinds, *was, row));
  }
  std::ranges::stable_sort(changes, {}, place_of);
  return changes;
}

std::string holding(const RowChange& row) {
  const auto word = [](const std::optional<bool>& holds) { return !holds ? "" : *holds ? "yes" : "**no**"; };
  if (!row.holding_changes)
    return word(row.after->holds);
  const bool lost = row.change == Change::worse;
  return fmt::format("{} -> {}{}{}", word(row.before->holds), word(row.after->holds), lost ? ": " : "",
                     lost ? row.after->broken : "");
}

std::string shown(const FigureKind& kind, const std::optional<double>& before, const std::optional<double>& after) {
  const auto number = [&](const std::optional<double>& value) {
    return value ? fmt::format("{:.{}f}", kind.shown_per_unit * *value, kind.decimals) : "none";
  };
  if (!before && !after)
    return "";
  if (number(before) == number(after))
    return number(after);
  const bool counts = gain_of(kind, before, after) != 0;
  const bool has_share = counts && before && after && *before > 0;
  return fmt::format("{} -> {}{}", number(before), number(after),
                     has_share ? fmt::format(" ({:+.0f} %)", 100 * (*after / *before - 1)) : "");
}

std::string line_of(const std::vector<FigureKind>& kinds, const RowChange& row) {
  const char* const verdict = row.change == Change::worse    ? "**worse**"
                              : row.change == Change::better ? "better"
                                                             : "same";
  std::string line = fmt::format("| {} | {} | {} |", verdict, row.after->name, holding(row));
  for (std::size_t i = 0; i < kinds.size(); ++i)
    line += fmt::format(" {} |", shown(kinds[i], row.before->figures[i], row.after->figures[i]));
  return line + '\n';
}

/// Lists the `rows` that are not among `others`, as a sentence; empty if there are none.
std::string only_in(const char* when, const std::vector<ComparedRow>& rows, const std::vector<ComparedRow>& others) {
  std::vector<std::string> names;
  for (const ComparedRow& row : rows) {
    if (row_named(others, row.name) == nullptr)
      names.push_back(row.name);
  }
  return names.empty() ? "" : fmt::format("\nOnly {}, {}: {}.\n", when, names.size(), fmt::join(names, "; "));
}

std::string summary_of(const std::vector<RowChange>& changes) {
  const auto count = [&](const auto& which) { return std::ranges::count_if(changes, which); };
  const auto are = [&](Change change) { return count([=](const RowChange& row) { return row.change == change; }); };
  const auto holding = [&](Change change) {
    return count([=](const RowChange& row) { return row.holding_changes && row.change == change; });
  };
  return fmt::format(
      "{} rows: {} worse, {} better, {} same, {} of these with equal figures. {} no longer hold, {} newly "
      "hold.\n",
      changes.size(), are(Change::worse), are(Change::better), are(Change::same),
      count([](const RowChange& row) { return row.equal; }), holding(Change::worse), holding(Change::better));
}

std::string what_is_same(const std::vector<FigureKind>& kinds) {
  std::vector<std::string> negligible;
  for (const FigureKind& kind : kinds) {
    if (kind.negligible > 0)
      negligible.push_back(fmt::format("{} {:g}", kind.name, kind.shown_per_unit * kind.negligible));
  }
  return fmt::format("A figure is the same if it differs by no more than {:.0f} %, half of what a fault may add, or by "
                     "no more than a negligible amount, about ten times the difference between instruction sets "
                     "({}). A row is worse if any of its figures is, and better if none is worse and one is better; "
                     "whether it holds takes precedence over its figures.\n",
                     100 * kSameShare, fmt::join(negligible, "; "));
}

std::string header_of(const std::vector<FigureKind>& kinds) {
  std::string names = "| | row | holds |", rule = "|---|---|---|";
  for (const FigureKind& kind : kinds) {
    names += fmt::format(" {} |", kind.name);
    rule += "---:|";
  }
  return names + '\n' + rule + '\n';
}

/// Returns the length of simulated courses; recordings have their own.
std::string length_of(const Results& results) {
  const Results& duration_s = results.at("duration_s");
  return duration_s.is_null() ? "" : fmt::format(", {} s", duration_s.dump());
}

std::string origin(const Results& results) {
  return fmt::format("version {}, {}", results.at("version").get<std::string>(), machines_of(results.at("runs")));
}

} // namespace

ResultsBefore::ResultsBefore(std::filesystem::path file)
    : file_(std::move(file)), results_(read_results(file_)), table_(table_of(results_)) {
  if (table_ == nullptr)
    return;
  try {
    rows_ = table_->rows(results_);
    origin_ = origin(results_);
  } catch (const Results::exception& error) {
    throw Failure(ExitStatus::failed, fmt::format("{}: its {} cannot be read ({}); write it again with this "
                                                  "locus-experiments",
                                                  file_.string(), table_->key, error.what()));
  }
}

void ResultsBefore::check_is_of(const Results& after) const {
  const ComparedTable* const table = table_of(after);
  if (table == nullptr)
    throw Failure(ExitStatus::failed, "--compare: the paper's experiments have no rows to compare; run --faults, "
                                      "--fault-matrix, --harsh or --subsets");
  if (table_ != table)
    throw Failure(ExitStatus::failed, fmt::format("{}: contains no results of this experiment ({}); name a "
                                                  "results.json that does",
                                                  file_.string(), table->key));
  if (realism_of(results_) != realism_of(after))
    throw Failure(ExitStatus::failed, fmt::format("{}: its courses are {}, these are {}; compare runs of the same "
                                                  "--realism",
                                                  file_.string(), realism_of(results_), realism_of(after)));
  for (const Results::json_pointer& pointer :
       {Results::json_pointer("/duration_s"), Results::json_pointer(fmt::format("/{}/seeds", table->key)),
        Results::json_pointer(fmt::format("/{}/starts", table->key))}) {
    const Results was = results_.value(pointer, Results{}), is = after.value(pointer, Results{});
    if (was != is)
      throw Failure(ExitStatus::failed, fmt::format("{}: {} is {} there and {} here; compare runs with the same value",
                                                    file_.string(), pointer.back(), was.dump(), is.dump()));
  }
}

std::string ResultsBefore::comparison_with(const Results& after) const {
  check_is_of(after);
  const std::vector<ComparedRow> rows_after = table_->rows(after);
  const std::vector<RowChange> changes = changes_between(*table_, rows_, rows_after);
  std::string page = fmt::format("`locus-experiments --compare {}`, {}{}. Before: {}. After: {}.\n\n{}\n{}\n{}",
                                 file_.string(), table_->key, length_of(after), origin_, origin(after),
                                 summary_of(changes), what_is_same(table_->kinds), header_of(table_->kinds));
  for (const RowChange& row : changes)
    page += line_of(table_->kinds, row);
  return page + only_in("before", rows_, rows_after) + only_in("after", rows_after, rows_);
}

std::string write_comparison(const ResultsBefore& before, const Results& after, const std::filesystem::path& folder) {
  std::string page = before.comparison_with(after);
  tools::OutputFile file(folder / "compare.md");
  file.print("{}", page);
  file.close();
  return page;
}

} // namespace locus::experiments
