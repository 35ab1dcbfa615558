// SPDX-License-Identifier: Apache-2.0
#include "locus_experiments/matrix_table.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <vector>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "locus_experiments/fault_verdict.hpp"
#include "locus_experiments/matrix_plan.hpp"

namespace locus::experiments {
namespace {

using Pointer = Results::json_pointer;

/// Error change below which a fault has no measurable effect.
constexpr double kNothing_m = 0.001;

/// Part of a summary that covers an input, each with its name in the table.
struct Account {
  std::string name;
  Pointer pointer;
};
std::vector<Account> accounts_of(const std::string& input) {
  if (input == "wio" || input == "imu")
    return {{input + '.', Pointer("/sources") / input}};
  const std::string lidar = input.substr(0, input.find('.'));
  return {{"", Pointer("/packets") / lidar}, {"sweeps.", Pointer("/sweeps")}};
}

std::string in_words(const Results& value) { return value.is_string() ? value.get<std::string>() : value.dump(); }

/// Lists, in words, differing counters of an input and its verdict, without those that only follow from others.
std::vector<std::string> differences(const std::string& input, const Pair& pair) {
  constexpr std::array kIgnored{"processed",     "used_sweeps",    "seen",
                                "dead_reckoned", "without_source", "largest_test_ratio"};
  std::vector<std::string> found;
  for (const Account& account : accounts_of(input)) {
    const Results with = pair.with->at("summary").at(account.pointer).flatten();
    const Results without = pair.without->at("summary").at(account.pointer).flatten();
    for (const auto& [key, now] : with.items()) {
      std::string name = key.substr(1);
      std::ranges::replace(name, '/', '.');
      const Results before = without.value(key, Results(0));
      if (now != before && std::ranges::count(kIgnored, name) == 0)
        found.push_back(fmt::format("{}{} {}", account.name, name, in_words(now)) +
                        (before == 0 ? "" : fmt::format(" of {}", in_words(before))));
    }
  }
  return found;
}

/// Returns evidence of the fault: the input's own counters, else those of the inputs that depend on it.
std::vector<std::string> shown_by(const MatrixCell& cell, const Pair& pair) {
  std::vector<std::string> shown = differences(cell.input, pair);
  for (const char* other : {"top", "wio", "imu"}) {
    if (shown.empty())
      shown = differences(other, pair);
  }
  return shown;
}

bool changes_nothing(const Pair& pair) {
  return std::ranges::all_of(std::vector{"mean", "max"}, [&](const char* figure) {
    const Pointer pointer = Pointer("/summary/ape_m") / figure;
    return std::abs(pair.with->at(pointer).get<double>() - pair.without->at(pointer).get<double>()) < kNothing_m;
  });
}

/// Returns whether sweeps are lost; a run may end one window earlier than another.
bool loses_sweeps(const MatrixCell& cell, const Pair& pair) {
  const auto sweeps = [](const Results* run, const char* which) {
    return run->at("summary").at("sweeps").at(which).get<double>();
  };
  const double all = sweeps(pair.without, "seen");
  const double silent = all * cell.silent_from_s / pair.without->at("summary").at("duration_s").get<double>();
  return sweeps(pair.with, "dropped") > 0 || sweeps(pair.with, "seen") < std::floor(all - silent) - 1;
}

Results driven(const MatrixCell& cell, const Pair& pair) {
  Verdict verdict = judge(cell.demand, cell.limit, kMatrixCourse, {pair});
  const std::vector<std::string> shown = shown_by(cell, pair);
  verdict.expect(!loses_sweeps(cell, pair), "sweeps are lost");
  verdict.expect(!shown.empty() || changes_nothing(pair), "not reported");
  return {{"asked", verdict.asked}, {"found", verdict.found}, {"shown", shown}, {"broken", verdict.broken}};
}

/// Judges a cell whose run was refused, or ended unexpectedly.
Results ended(const MatrixCell& cell, const Results& run) {
  const bool refused = run.contains("refused");
  const std::string message = run.value(refused ? "refused" : "failed", "");
  const auto broken = refused ? Results::array() : Results::array({"does not exit with 0: " + message});
  return {{"asked", cell.refusal.empty() ? "" : "status 1"},
          {"found", refused ? "status 1" : ""},
          {"shown", Results::array({cell.refusal.empty() ? message : cell.refusal})},
          {"broken", broken}};
}

/// Returns nothing if its run is not among these.
std::optional<Results> judged(const MatrixCell& cell, const RunsById& runs) {
  Results head{{"input", cell.input}, {"fault", cell.what}, {"from_start", cell.from_start}};
  if (!cell.impossible.empty()) {
    head["impossible"] = cell.impossible;
    return head;
  }
  const Results* const with = find(runs, matrix_course(), cell.configuration());
  const Results* const without = find(runs, matrix_course(), kNoFault);
  if (with == nullptr || without == nullptr)
    return std::nullopt;
  head["faults"] = cell.faults;
  if (with->contains("summary") && without->contains("summary")) {
    head.update(driven(cell, {with, without}));
    if (!cell.refusal.empty())
      head["broken"].push_back("is not rejected");
  } else {
    head.update(ended(cell, with->contains("summary") ? *without : *with));
  }
  head["holds"] = head.at("broken").empty();
  return head;
}

std::string text_of(const Results& cell) {
  if (cell.contains("impossible"))
    return "not applicable: " + cell.at("impossible").get<std::string>() + " | |";
  const auto broken = cell.at("broken").get<std::vector<std::string>>();
  const auto shown = cell.at("shown").get<std::vector<std::string>>();
  return fmt::format("{}{} | {} |", broken.empty() ? "yes: " : fmt::format("**no**, {}: ", fmt::join(broken, "; ")),
                     cell.at("found").get<std::string>(),
                     shown.empty() ? "nothing (no effect)" : fmt::format("{}", fmt::join(shown, ", ")));
}

} // namespace

void judge_matrix(Results& results) {
  const RunsById runs = by_id(results.at("runs"));
  Results cells = Results::array();
  for (const MatrixCell& cell : matrix_cells(results.at("duration_s"))) {
    if (std::optional<Results> judgement = judged(cell, runs))
      cells.push_back(std::move(*judgement));
  }
  results["matrix"]["cells"] = std::move(cells);
}

std::string matrix_table(const Results& results) {
  const Results& cells = results.at("matrix").at("cells");
  const auto count = [&](const auto& which) { return std::ranges::count_if(cells, which); };
  const auto run = count([](const Results& cell) { return cell.contains("holds"); });
  const auto hold = count([](const Results& cell) { return cell.value("holds", false); });
  const auto impossible = count([](const Results& cell) { return cell.contains("impossible"); });
  std::string text =
      fmt::format("`locus-experiments --fault-matrix --realism {} --duration {}`, version {}, {}. {} of {} cells "
                  "hold; {} more are not applicable.\n\n",
                  realism_of(results), results.at("duration_s").get<int>(), results.at("version").get<std::string>(),
                  machines_of(results.at("runs")), hold, run, impossible);
  text += "| input | fault | from the start: holds, error | shown by | mid-drive: holds, error | shown by |\n"
          "|---|---|---|---|---|---|\n";
  for (const Results& cell : cells) {
    if (cell.at("from_start").get<bool>())
      text += fmt::format("| {} | {} |", cell.at("input").get<std::string>(), cell.at("fault").get<std::string>());
    text += ' ' + text_of(cell) + (cell.at("from_start").get<bool>() ? "" : "\n");
  }
  return text;
}

} // namespace locus::experiments
