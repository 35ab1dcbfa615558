// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <string>
#include <vector>

namespace locus::experiments {

/// A piece of work in another process.
struct Task {
  std::string name;
  double expected_s = 1;       ///< for the progress bar
  bool alone = false;          ///< measures time: nothing else may run
  std::function<void()> run;   ///< must not throw; any thread
  std::vector<Task> then = {}; ///< may begin when this is done, and do so before others; of a task that is alone none
};

/// Runs the tasks, `jobs` at a time, then those that must be alone, one after the other; shows how far it has come and
/// prints the name of each when it is done.
void conduct(const std::vector<Task>& tasks, int jobs, bool quiet);

} // namespace locus::experiments
