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

/// By Run::id(). The runs must outlive it.
RunsById by_id(const Results& runs);
/// nullptr if there is no such run.
const Results* find(const RunsById& runs, const std::string& course, const std::string& configuration);

/// One seed: the run of a case, and the one without its fault.
struct Pair {
  const Results* with;
  const Results* without;
};
using Pairs = std::vector<Pair>;

using Figure = std::function<double(const Pair&)>;
double median(const Pairs& pairs, const Figure& figure);
double largest(const Pairs& pairs, const Figure& figure);

double with_m(const Pair& pair);    ///< mean position error
double without_m(const Pair& pair); ///< of the run without the fault
double length_m(const Pair& pair);
double worst_sigma(const Pair& pair);

/// What was asked, what was found, what of it is not good enough.
struct Verdict {
  std::string asked, found;
  std::vector<std::string> broken;

  /// `what` is broken unless `good`.
  Verdict& expect(bool good, const char* what);
};

/// Whether a kind of course was driven as demanded; the limit is that of the demand. Precondition: there are pairs.
Verdict judge(Demand demand, double limit, const std::string& kind_of_course, const Pairs& pairs);

/// The processors that the runs were done on, for the head of a table.
std::string machines_of(const Results& runs);

/// How realistic the simulated courses were; results of versions that knew no realism are of clean ones.
std::string realism_of(const Results& results);

} // namespace locus::experiments
