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
#include "locus_replay/quantiles.hpp"

namespace locus::experiments {
namespace {

constexpr double kAlwaysAllowed_m = 0.01;
constexpr double kHonestSigmas = 3;
constexpr double kHonestLeast = 3, kHonestMost = 12; ///< normalised squared error of six axes

/// One seed: the run of a case, and the one without its fault.
struct Pair {
  const Results* with;
  const Results* without;
};
using Pairs = std::vector<Pair>;

using RunsById = std::map<std::string, const Results*>;

RunsById by_id(const Results& runs) {
  RunsById found;
  for (const Results& run : runs)
    found[run.at("course").get<std::string>() + '/' + run.at("configuration").get<std::string>()] = &run;
  return found;
}

const Results* find(const RunsById& runs, const std::string& course, const std::string& configuration) {
  const auto found = runs.find(course + '/' + configuration);
  return found == runs.end() ? nullptr : found->second;
}

using Figure = std::function<double(const Pair&)>;

std::vector<double> values_of(const Pairs& pairs, const Figure& figure) {
  std::vector<double> values;
  std::ranges::transform(pairs, std::back_inserter(values), figure);
  return values;
}
double median(const Pairs& pairs, const Figure& figure) { return tools::Quantiles(values_of(pairs, figure)).at(0.5); }
double largest(const Pairs& pairs, const Figure& figure) { return tools::Quantiles(values_of(pairs, figure)).at(1.0); }

double ape_m(const Results& run) { return run.at("summary").at("ape_m").at("mean"); }
double with_m(const Pair& pair) { return ape_m(*pair.with); }
double without_m(const Pair& pair) { return ape_m(*pair.without); }
double difference_m(const Pair& pair) { return with_m(pair) - without_m(pair); }
double added_m(const Pair& pair) { return pair.with->at("fault").at("added_m"); }
double length_m(const Pair& pair) { return pair.with->at("fault").at("length_m"); }
double told(const Pair& pair) { return pair.with->at("fault").at("told"); }
double worst_sigma(const Pair& pair) { return pair.with->at("summary").at("covariance").at("worst_sigma"); }

std::string mm(double metres) { return fmt::format("{:.1f} mm", 1e3 * metres); }

/// What was asked, what was found, what of it is not good enough.
struct Verdict {
  std::string asked, found;
  std::vector<std::string> broken;

  /// `what` is broken unless `good`.
  Verdict& expect(bool good, const char* what) {
    if (!good)
      broken.emplace_back(what);
    return *this;
  }
};

Verdict accurate(const Pairs& pairs, double limit_m) {
  const double mean_m = median(pairs, with_m);
  return Verdict{"error <= " + mm(limit_m), mm(mean_m), {}}.expect(mean_m <= limit_m, "too large an error");
}

Verdict honest(const Pairs& pairs) {
  const double sigmas = largest(pairs, worst_sigma);
  return Verdict{fmt::format("<= {} sigma", kHonestSigmas),
                 fmt::format("{:.0f} % flagged, {:.1f} sigma", 100 * median(pairs, told), sigmas),
                 {}}
      .expect(sigmas <= kHonestSigmas, "farther off than its covariance says");
}

Verdict both(Verdict one, const Verdict& other, const char* conjunction) {
  one.asked += conjunction + other.asked;
  one.found += "; " + other.found;
  one.broken.insert(one.broken.end(), other.broken.begin(), other.broken.end());
  return one;
}

Verdict unharmed(const Pairs& pairs, double limit) {
  const double allowed_m = std::max(limit * median(pairs, without_m), kAlwaysAllowed_m);
  const double more_m = median(pairs, difference_m);
  return Verdict{
      fmt::format("within {:.0f} %", 100 * limit), fmt::format("{:+.1f} mm of {}", 1e3 * more_m, mm(allowed_m)), {}}
      .expect(more_m <= allowed_m, "more error than allowed");
}

Verdict unharmed_or_told(const Pairs& pairs, double limit) {
  const Verdict error = unharmed(pairs, limit);
  Verdict either = both(error, honest(pairs).expect(median(pairs, told) > 0, "not flagged"), ", or flagged and ");
  if (error.broken.empty() || either.broken.size() == error.broken.size())
    either.broken.clear();
  return either;
}

Verdict carried(const Pairs& pairs, double limit, const std::string& source) {
  const Figure drift_m = [&](const Pair& pair) {
    return pair.with->at("fault").at("sources").at(source).at("added_m").get<double>();
  };
  const Figure excess_m = [&](const Pair& pair) {
    return added_m(pair) - std::max(limit * drift_m(pair), kAlwaysAllowed_m);
  };
  return Verdict{fmt::format("added <= {} x {}'s drift", limit, source),
                 fmt::format("{}; {} {}", mm(median(pairs, added_m)), source, mm(median(pairs, drift_m))),
                 {}}
      .expect(median(pairs, excess_m) <= 0, "more added than allowed");
}

Verdict resisted(const Pairs& pairs, double limit_m) {
  const double across_m = median(pairs, added_m), more_m = median(pairs, difference_m);
  return Verdict{
      "added <= " + mm(limit_m), fmt::format("{} meanwhile, {:+.1f} mm in the mean", mm(across_m), 1e3 * more_m), {}}
      .expect(std::max(across_m, more_m) <= limit_m, "more added than allowed");
}

Verdict no_worse_than_wheels(const Pairs& pairs, const std::string& source) {
  constexpr double kGrowsAlong = 10, kStaysAcross = 2;
  const Figure wheels_m = [&](const Pair& pair) {
    return pair.with->at("fault").at("sources").at(source).at("ape_mean_m").get<double>();
  };
  const auto growth = [&](const char* axis) {
    return median(pairs, [axis](const Pair& pair) {
      const Results& both = pair.with->at("fault").at("growth");
      return both.is_null() ? 0.0 : both.at(axis).get<double>();
    });
  };
  const double along = growth("along"), across = growth("across");
  const double excess_m = median(pairs, [&](const Pair& pair) { return with_m(pair) - wheels_m(pair); });
  return Verdict{
      fmt::format("error <= {}'s; variance along grows >= {} x, across < {} x", source, kGrowsAlong, kStaysAcross),
      fmt::format("{}, {} {}; along {:.0f} x, across {:.0f} x", mm(median(pairs, with_m)), source,
                  mm(median(pairs, wheels_m)), along, across),
      {}}
      .expect(excess_m <= 0, "worse than the wheels")
      .expect(along >= kGrowsAlong, "doubt along the way does not grow")
      .expect(across < kStaysAcross, "doubt across the way grows");
}

Verdict judge(const FaultCase& fault_case, const Pairs& pairs) {
  const std::string source = best_motion_source(fault_case.course);
  switch (fault_case.demand) {
  case Demand::accurate:
    return accurate(pairs, fault_case.limit);
  case Demand::accurate_and_honest:
    return both(accurate(pairs, fault_case.limit), honest(pairs), "; ");
  case Demand::unharmed:
    return unharmed(pairs, fault_case.limit);
  case Demand::unharmed_or_told:
    return unharmed_or_told(pairs, fault_case.limit);
  case Demand::carried:
    return carried(pairs, fault_case.limit, source);
  case Demand::resisted:
    return resisted(pairs, fault_case.limit);
  case Demand::no_worse_than_wheels:
    return no_worse_than_wheels(pairs, source);
  }
  return {};
}

struct Sweeps {
  std::int64_t lost = 0, failed = 0, failed_without = 0;
};

/// A run may end one window earlier than another.
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

/// How often the health of a source changed, seed by seed.
std::vector<int> health_changes(const Pairs& pairs, const std::string& source) {
  std::vector<int> changes;
  for (const Pair& pair : pairs) {
    const Results& sources = pair.with->at("summary").at("sources");
    if (sources.contains(source))
      changes.push_back(sources.at(source).at("health_changes"));
  }
  return changes;
}

/// What the table says of the health of a source, and what is wrong with that.
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
    return {source + " unnoticed", source + " is not found out on every seed"};
  if (fault_case.lasting == Lasting::second_half)
    return {source + " lost", ends_lost ? "" : source + " is lost and taken back"};
  if (ends_lost)
    return {source + " lost", source + " is not taken back on every seed"};
  return {fmt::format("{} lost, back{}", source, most > 2 ? fmt::format(", up to {} x", most / 2) : ""), ""};
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
  const Verdict verdict = judge(fault_case, pairs);
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

/// Nothing where none of its runs is among these: they are another shard's.
std::optional<Results> row_of(const FaultCase& fault_case, const RunsById& runs, int seeds) {
  Pairs pairs;
  std::vector<std::string> failed;
  for (int seed = 1; seed <= seeds; ++seed) {
    const Results* with = find(runs, fault_course(fault_case.course, seed), fault_case.configuration);
    const Results* without = find(runs, fault_course(fault_case.reference_course(), seed), kNoFault);
    if (with == nullptr || without == nullptr)
      continue;
    if (with->contains("failed") || without->contains("failed"))
      failed.push_back(fmt::format("seed {} did not run", seed));
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

/// {"runs", "failed", "nees_10m", "median", "p90", "holds"} of the runs for the covariances; null without any. A run
/// that gives no figure has failed, and what fails does not hold.
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
                     "runs of 60 s, is {:.1f} (median {:.1f}, 90 % below {:.1f}); {:.0f} to {:.0f} is asked for six "
                     "axes: {}{}.\n",
                     consistency.at("runs").get<int>(), consistency.at("nees_10m").get<double>(),
                     consistency.at("median").get<double>(), consistency.at("p90").get<double>(), kHonestLeast,
                     kHonestMost, consistency.at("holds").get<bool>() ? "holds" : "**does not hold**",
                     failed > 0 ? fmt::format("; {} more runs failed", failed) : "");
}

std::string machines_of(const Results& runs) {
  std::set<std::string> machines;
  for (const Results& run : runs) {
    if (run.contains("machine"))
      machines.insert(run.at("machine").get<std::string>());
  }
  return fmt::format("{}", fmt::join(machines, "; "));
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
  std::string text = fmt::format(
      "`locus-experiments --faults --duration {} --seeds {} --consistency {}`, version {}, {}. {} of {} rows hold.\n\n",
      results.at("duration_s").get<int>(), faults.at("seeds").get<int>(), faults.at("consistency_runs").get<int>(),
      results.at("version").get<std::string>(), machines_of(results.at("runs")), hold, rows.size());
  text += "| fault | robot, place | error without, mm | with, mm | asked | found | holds | sweeps lost, failed | "
          "health | worst sigma | NEES |\n|---|---|---:|---:|---|---|---|---|---|---:|---:|\n";
  for (const Results& row : rows)
    text += line_of(row);
  return text + consistency_line(faults.at("consistency"));
}

} // namespace locus::experiments
