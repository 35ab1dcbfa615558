// SPDX-License-Identifier: Apache-2.0
#include "locus_experiments/fault_table.hpp"

#include <algorithm>
#include <cstdint>
#include <functional>
#include <map>
#include <numeric>
#include <optional>
#include <set>
#include <vector>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "locus_experiments/fault_plan.hpp"
#include "locus_experiments/fault_verdict.hpp"
#include "locus_replay/quantiles.hpp"

namespace locus::experiments {
namespace {

constexpr double kHonestLeast = 3, kHonestMost = 12; ///< accepted NEES (six axes)

struct Sweeps {
  std::int64_t lost = 0, failed = 0, failed_without = 0;
};

/// Counts sweeps; a run may end one window earlier than another.
Sweeps count_sweeps(const Pairs& pairs) {
  Sweeps sum;
  for (const Pair& pair : pairs) {
    const Results &with = pair.with->at("summary").at("sweeps"), &without = pair.without->at("summary").at("sweeps");
    const auto missing = without.at("seen").get<std::int64_t>() - with.at("seen").get<std::int64_t>();
    sum.lost += with.at("dropped").get<std::int64_t>() + std::max<std::int64_t>(0, missing - 1);
    sum.failed += with.at("failed").get<std::int64_t>();
    sum.failed_without += without.at("failed").get<std::int64_t>();
  }
  return sum;
}

/// Counts the health changes of a source, seed by seed.
std::vector<int> health_changes(const Pairs& pairs, const std::string& source) {
  std::vector<int> changes;
  for (const Pair& pair : pairs) {
    const Results& sources = pair.with->at("summary").at("sources");
    if (sources.contains(source))
      changes.push_back(sources.at(source).at("health_changes"));
  }
  return changes;
}

/// Health of a source as shown in the table, and what is wrong with it.
struct HealthFound {
  std::string text, broken;
};
HealthFound judge_health(const std::string& source, const std::vector<int>& changes, const FaultCase& fault_case) {
  const bool faulty = std::ranges::count(fault_case.faulty(), source) > 0;
  const int least = *std::ranges::min_element(changes), most = *std::ranges::max_element(changes);
  const bool ends_lost = std::ranges::any_of(changes, [](int count) { return count % 2 != 0; });
  if (!faulty || fault_case.lasting == Lasting::always) {
    if (most == 0)
      return {};
    return {fmt::format("{} changes {} x", source, fmt::join(changes, ", ")), ""};
  }
  if (least == 0)
    return {source + " not detected", source + " is not detected on every seed"};
  if (fault_case.lasting == Lasting::second_half)
    return {source + " lost", ends_lost ? "" : source + " is used again although the fault lasts"};
  if (ends_lost)
    return {source + " lost", source + " is not used again on every seed"};
  return {fmt::format("{} lost, used again{}", source, most > 2 ? fmt::format(", up to {} x", most / 2) : ""), ""};
}

std::set<std::string> names_of_sources(const Pairs& pairs) {
  std::set<std::string> names;
  for (const Pair& pair : pairs) {
    for (const auto& [name, unused] : pair.with->at("summary").at("sources").items())
      names.insert(name);
  }
  return names;
}

Results median_nees(const Pairs& pairs) {
  std::vector<double> values;
  for (const Pair& pair : pairs) {
    if (const Results& nees = pair.with->at("summary").at("covariance").at("nees_10m"); nees.is_number())
      values.push_back(nees);
  }
  return values.empty() ? Results(nullptr) : Results(tools::Quantiles(values).at(0.5));
}

Results judged(const FaultCase& fault_case, const Pairs& pairs) {
  const Verdict verdict = judge(fault_case.demand, fault_case.limit, fault_case.course, pairs);
  const Sweeps sweeps = count_sweeps(pairs);
  std::vector<std::string> broken = verdict.broken, health;
  if (sweeps.lost > 0)
    broken.emplace_back("sweeps are lost");
  const auto silent = static_cast<std::int64_t>(pairs.size()) * fault_case.silent_sweeps;
  if (fault_case.demand != Demand::carried && sweeps.failed > sweeps.failed_without + silent)
    broken.emplace_back("sweeps fail");
  for (const std::string& source : names_of_sources(pairs)) {
    const HealthFound found = judge_health(source, health_changes(pairs, source), fault_case);
    if (!found.text.empty())
      health.push_back(found.text);
    if (!found.broken.empty())
      broken.push_back(found.broken);
  }
  return {{"asked", verdict.asked},
          {"found", verdict.found},
          {"broken", broken},
          {"length_m", median(pairs, length_m)},
          {"ape_mean_m", {{"without", median(pairs, without_m)}, {"with", median(pairs, with_m)}}},
          {"sweeps", {{"lost", sweeps.lost}, {"failed", sweeps.failed}}},
          {"health", health},
          {"worst_sigma", largest(pairs, worst_sigma)},
          {"nees_10m", median_nees(pairs)}};
}

/// Returns nothing if none of its runs is among these.
std::optional<Results> row_of(const FaultCase& fault_case, const RunsById& runs, int seeds) {
  Pairs pairs;
  std::vector<std::string> failed;
  for (int seed = 1; seed <= seeds; ++seed) {
    const Results* with = find(runs, fault_course(fault_case.course, seed), fault_case.configuration);
    const Results* without = find(runs, fault_course(fault_case.reference_course(), seed), kNoFault);
    if (with == nullptr || without == nullptr)
      continue;
    if (with->contains("failed") || without->contains("failed"))
      failed.push_back(fmt::format("seed {} failed", seed));
    else
      pairs.push_back({with, without});
  }
  if (pairs.empty() && failed.empty())
    return std::nullopt;
  Results row{{"fault", fault_case.what}, {"course", fault_case.course}, {"configuration", fault_case.configuration}};
  if (pairs.empty())
    row["broken"] = Results::array();
  else
    row.update(judged(fault_case, pairs));
  for (const std::string& failure : failed)
    row["broken"].push_back(failure);
  row["holds"] = row["broken"].empty();
  return row;
}

/// Computes {"runs", "failed", "nees_10m", "median", "p90", "holds"} of the runs that test the covariances; null
/// without any. A run without a figure counts as failed, and a failure does not hold.
Results consistency_of(const RunsById& runs, int count) {
  std::vector<double> values;
  int failed = 0;
  for (int i = 0; i < count; ++i) {
    const Results* run = find(runs, honesty_course(i), kNoFault);
    if (run == nullptr)
      continue;
    if (!run->contains("failed") && run->at("summary").at("covariance").at("nees_10m").is_number())
      values.push_back(run->at("summary").at("covariance").at("nees_10m"));
    else
      ++failed;
  }
  if (values.empty() && failed == 0)
    return nullptr;
  const double mean =
      std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(std::max<std::size_t>(1, values.size()));
  const tools::Quantiles quantiles(values);
  return {{"runs", values.size()},    {"failed", failed},
          {"nees_10m", mean},         {"median", quantiles.at(0.5)},
          {"p90", quantiles.at(0.9)}, {"holds", failed == 0 && mean >= kHonestLeast && mean <= kHonestMost}};
}

std::string line_of(const Results& row) {
  const std::string fault = row.at("fault"), course = describe_course(row.at("course"));
  const auto broken = row.at("broken").get<std::vector<std::string>>();
  const std::string holds = broken.empty() ? "yes" : fmt::format("**no**: {}", fmt::join(broken, "; "));
  if (!row.contains("found"))
    return fmt::format("| {} | {} | | | | | {} | | | | |\n", fault, course, holds);
  const Results &ape = row.at("ape_mean_m"), &sweeps = row.at("sweeps"), &nees = row.at("nees_10m");
  return fmt::format(
      "| {} | {}, {:.0f} m | {:.1f} | {:.1f} | {} | {} | {} | {}, {} | {} | {:.1f} | {} |\n", fault, course,
      row.at("length_m").get<double>(), 1e3 * ape.at("without").get<double>(), 1e3 * ape.at("with").get<double>(),
      row.at("asked").get<std::string>(), row.at("found").get<std::string>(), holds, sweeps.at("lost").get<int>(),
      sweeps.at("failed").get<int>(), fmt::join(row.at("health").get<std::vector<std::string>>(), "; "),
      row.at("worst_sigma").get<double>(), nees.is_number() ? fmt::format("{:.1f}", nees.get<double>()) : "");
}

std::string consistency_line(const Results& consistency) {
  if (consistency.is_null())
    return "";
  const int failed = consistency.at("failed");
  return fmt::format("\nCovariances: the normalised squared error of the relative pose over 10 m, mean over {} seeded "
                     "runs of 60 s, is {:.1f} (median {:.1f}, 90 % below {:.1f}); {:.0f} to {:.0f} is required for six "
                     "axes: {}{}.\n",
                     consistency.at("runs").get<int>(), consistency.at("nees_10m").get<double>(),
                     consistency.at("median").get<double>(), consistency.at("p90").get<double>(), kHonestLeast,
                     kHonestMost, consistency.at("holds").get<bool>() ? "holds" : "**does not hold**",
                     failed > 0 ? fmt::format("; {} more runs failed", failed) : "");
}

} // namespace

void judge_faults(Results& results) {
  const RunsById runs = by_id(results.at("runs"));
  Results& faults = results.at("faults");
  Results rows = Results::array();
  for (const FaultCase& fault_case : fault_cases()) {
    if (std::optional<Results> row = row_of(fault_case, runs, faults.at("seeds")))
      rows.push_back(std::move(*row));
  }
  faults["rows"] = std::move(rows);
  faults["consistency"] = consistency_of(runs, faults.at("consistency_runs"));
}

std::string fault_table(const Results& results) {
  const Results& faults = results.at("faults");
  const Results& rows = faults.at("rows");
  const auto hold = std::ranges::count_if(rows, [](const Results& row) { return row.at("holds").get<bool>(); });
  std::string text =
      fmt::format("`locus-experiments --faults --realism {} --duration {} --seeds {} --consistency {}`, version {}, "
                  "{}. {} of {} rows hold.\n\n",
                  realism_of(results), results.at("duration_s").get<int>(), faults.at("seeds").get<int>(),
                  faults.at("consistency_runs").get<int>(), results.at("version").get<std::string>(),
                  machines_of(results.at("runs")), hold, rows.size());
  text += "| fault | robot, place | error without, mm | with, mm | required | measured | holds | sweeps lost, failed | "
          "health | worst sigma | NEES |\n|---|---|---:|---:|---|---|---|---|---|---:|---:|\n";
  for (const Results& row : rows)
    text += line_of(row);
  return text + consistency_line(faults.at("consistency"));
}

} // namespace locus::experiments
