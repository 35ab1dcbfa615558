// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include <sched.h>

namespace locus::test {

/// The command, run so that other programs on this machine do not delay it, where that is permitted: what is then late
/// or lost is its own fault.
inline std::vector<std::string> undisturbed(std::vector<std::string> command) {
  const sched_param fifo{3}, ordinary{0};
  if (sched_setscheduler(0, SCHED_FIFO, &fifo) != 0)
    return command;
  sched_setscheduler(0, SCHED_OTHER, &ordinary);
  command.insert(command.begin(), {"/usr/bin/chrt", "--fifo", "3"});
  return command;
}

} // namespace locus::test
