// SPDX-License-Identifier: Apache-2.0
#include "locus_experiments/fault_verdict.hpp"

#include <algorithm>
#include <iterator>
#include <set>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "locus_replay/quantiles.hpp"

namespace locus::experiments {
namespace {

constexpr double kAlwaysAllowed_m = 0.01;
constexpr double kHonestSigmas = 3;

std::vector<double> values_of(const Pairs& pairs, const Figure& figure) {
  std::vector<double> values;
  std::ranges::transform(pairs, std::back_inserter(values), figure);
  return values;
}

double ape_m(const Results& run) { return run.at("summary").at("ape_m").at("mean"); }
double difference_m(const Pair& pair) { return with_m(pair) - without_m(pair); }
double added_m(const Pair& pair) { return pair.with->at("fault").at("added_m"); }
double flagged_share(const Pair& pair) { return pair.with->at("fault").at("told"); }

std::string mm(double metres) { return fmt::format("{:.1f} mm", 1e3 * metres); }

Verdict accurate(const Pairs& pairs, double limit_m) {
  const double mean_m = median(pairs, with_m);
  return Verdict{"error <= " + mm(limit_m), mm(mean_m), {}}.expect(mean_m <= limit_m, "error too large");
}

Verdict honest(const Pairs& pairs) {
  const double sigmas = largest(pairs, worst_sigma);
  return Verdict{fmt::format("<= {} sigma", kHonestSigmas),
                 fmt::format("{:.0f} % flagged, {:.1f} sigma", 100 * median(pairs, flagged_share), sigmas),
                 {}}
      .expect(sigmas <= kHonestSigmas, "error beyond 3 sigma");
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

Verdict unharmed_or_flagged(const Pairs& pairs, double limit) {
  const Verdict error = unharmed(pairs, limit);
  Verdict either =
      both(error, honest(pairs).expect(median(pairs, flagged_share) > 0, "not flagged"), ", or flagged and ");
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
      .expect(median(pairs, excess_m) <= 0, "added error too large");
}

Verdict resisted(const Pairs& pairs, double limit_m) {
  const double across_m = median(pairs, added_m), more_m = median(pairs, difference_m);
  return Verdict{"added <= " + mm(limit_m),
                 fmt::format("{} during the fault, {:+.1f} mm in the mean", mm(across_m), 1e3 * more_m),
                 {}}
      .expect(std::max(across_m, more_m) <= limit_m, "added error too large");
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
      .expect(along >= kGrowsAlong, "variance along the path does not grow")
      .expect(across < kStaysAcross, "variance across the path grows");
}

} // namespace

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

double median(const Pairs& pairs, const Figure& figure) { return tools::Quantiles(values_of(pairs, figure)).median(); }
double largest(const Pairs& pairs, const Figure& figure) { return tools::Quantiles(values_of(pairs, figure)).at(1.0); }
double with_m(const Pair& pair) { return ape_m(*pair.with); }
double without_m(const Pair& pair) { return ape_m(*pair.without); }
double length_m(const Pair& pair) { return pair.with->at("fault").at("length_m"); }
double worst_sigma(const Pair& pair) { return pair.with->at("summary").at("covariance").at("worst_sigma"); }

Verdict& Verdict::expect(bool good, const char* what) {
  if (!good)
    broken.emplace_back(what);
  return *this;
}

Verdict judge(Demand demand, double limit, const std::string& kind_of_course, const Pairs& pairs) {
  const std::string source = best_motion_source(kind_of_course);
  switch (demand) {
  case Demand::accurate:
    return accurate(pairs, limit);
  case Demand::accurate_and_honest:
    return both(accurate(pairs, limit), honest(pairs), "; ");
  case Demand::unharmed:
    return unharmed(pairs, limit);
  case Demand::unharmed_or_flagged:
    return unharmed_or_flagged(pairs, limit);
  case Demand::carried:
    return carried(pairs, limit, source);
  case Demand::resisted:
    return resisted(pairs, limit);
  case Demand::no_worse_than_wheels:
    return no_worse_than_wheels(pairs, source);
  }
  return {};
}

std::string machines_of(const Results& runs) {
  std::set<std::string> machines;
  for (const Results& run : runs) {
    if (run.contains("machine"))
      machines.insert(run.at("machine").get<std::string>());
  }
  return fmt::format("{}", fmt::join(machines, "; "));
}

std::string in_mm(double metres) { return fmt::format("{:.{}f}", 1e3 * metres, metres < 0.1 ? 1 : 0); }

std::string realism_of(const Results& results) { return results.value("realism", std::string{"clean"}); }

} // namespace locus::experiments
