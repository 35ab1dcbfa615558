// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace locus::experiments {

/// Command line arguments.
struct Arguments {
  std::filesystem::path output;
  std::vector<std::filesystem::path> recordings; ///< capture folders; empty: the paper's courses, simulated
  std::filesystem::path compare;                 ///< results.json to compare the rows with; empty: none
  int duration_s = 300;                          ///< length of a simulated course
  std::string realism = "real";                  ///< of simulated courses, as for locus-sim
  int pace_s = 60;                               ///< length of a run at the pace of the recording
  bool faults = false;                           ///< the table of faults instead of the paper's experiments
  bool fault_matrix = false;                     ///< the matrix of faults instead
  bool harsh = false;                            ///< the harsh courses instead
  std::string only = {};                         ///< of these: COURSE/IMPERFECTION contains this
  bool subsets = false;                          ///< each subset of the sources instead, on recordings or harsh courses
  int starts = 1;                                ///< for each course or recording of `subsets`
  int seeds = 3;                                 ///< for each course of the faults and of the harsh ones
  bool accuracy = false;                         ///< results on recordings instead; `recordings`: where to search
  bool simulated = false;                        ///< adds a few simulated drives to these
  int honesty_runs = 100;                        ///< for the row on the covariances
  int jobs = 1;
  std::string launcher = {}; ///< shell words that start simulations and runs; empty: run directly
  bool keep_captures = false;
  bool quiet = false;
};

/// Returns nothing if help or version were requested and have been printed. Throws tools::Failure.
std::optional<Arguments> parse_arguments(int argc, char** argv);

} // namespace locus::experiments
