// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace locus::experiments {

/// What the user asked for.
struct Arguments {
  std::filesystem::path output;
  std::vector<std::filesystem::path> recordings; ///< capture folders; empty: the paper's courses, simulated
  std::filesystem::path compare;                 ///< results.json to compare the rows with; empty: none
  int duration_s = 300;                          ///< of a simulated course
  std::string realism = "real";                  ///< of simulated courses, as locus-sim has it
  int pace_s = 60;                               ///< of a run at the pace of the recording
  bool faults = false;                           ///< the table of faults in place of the paper's experiments
  bool fault_matrix = false;                     ///< the matrix of faults in their place
  bool harsh = false;                            ///< the harsh courses in their place
  std::string only = {};                         ///< of these, whose COURSE/IMPERFECTION holds this
  int seeds = 3;                                 ///< of each course of the faults and of the harsh ones
  bool accuracy = false;                         ///< what recordings show in their place; `recordings`: where to look
  bool simulated = false;                        ///< and a few simulated drives beside them
  int honesty_runs = 100;                        ///< for its line on the covariances
  int jobs = 1;
  std::string launcher = {}; ///< what starts the simulations and runs, in the words of a shell; empty: they themselves
  bool keep_captures = false;
  bool quiet = false;
};

/// Nothing where help or version were asked for and have been printed. Throws tools::Failure.
std::optional<Arguments> parse_arguments(int argc, char** argv);

} // namespace locus::experiments
