// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <map>
#include <string>
#include <vector>

#include "locus_experiments/fault_plan.hpp"
#include "locus_experiments/results.hpp"

namespace locus::experiments {

using RunsById = std::map<std::string, const Results*>;

/// Indexes runs by Run::id(). The runs must outlive it.
RunsById by_id(const Results& runs);
/// Returns nullptr if there is no such run.
const Results* find(const RunsById& runs, const std::string& course, const std::string& configuration);

/// Runs of one seed: with and without the fault of a case.
struct Pair {
  const Results* with;
  const Results* without;
};
using Pairs = std::vector<Pair>;

using Figure = std::function<double(const Pair&)>;
double median(const Pairs& pairs, const Figure& figure);
double largest(const Pairs& pairs, const Figure& figure);

double with_m(const Pair& pair);    ///< mean position error
double without_m(const Pair& pair); ///< same, of the run without the fault
double length_m(const Pair& pair);
double worst_sigma(const Pair& pair);

/// Criterion, finding and violations.
struct Verdict {
  std::string asked, found;
  std::vector<std::string> broken;

  /// Adds `what` to the violations unless `good`.
  Verdict& expect(bool good, const char* what);
};

/// Evaluates the demand, with its limit, for a kind of course. Precondition: there are pairs.
Verdict judge(Demand demand, double limit, const std::string& kind_of_course, const Pairs& pairs);

/// Lists the processors of the runs, for the head of a table.
std::string machines_of(const Results& runs);

/// Formats metres as millimetres, three digits whatever their size.
std::string in_mm(double metres);

/// Describes the realism of the simulated courses; results without one (older versions) are of clean courses.
std::string realism_of(const Results& results);

} // namespace locus::experiments
