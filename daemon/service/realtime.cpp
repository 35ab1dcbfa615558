// SPDX-License-Identifier: Apache-2.0
#include "daemon/service/realtime.hpp"

#include <cerrno>
#include <cstring>

#include <fmt/format.h>
#include <sched.h>
#include <sys/mman.h>

namespace locus::daemon {

namespace {

std::string refused(const char* what, const char* advice) {
  return fmt::format("{} was not granted ({}); the service runs without; {}", what, std::strerror(errno), // NOLINT
                     advice);
}

} // namespace

std::optional<std::string> lock_memory(bool wanted) {
  if ((wanted ? mlockall(MCL_CURRENT | MCL_FUTURE) : munlockall()) == 0)
    return std::nullopt;
  return refused("realtime.lock_memory", "grant it as /usr/share/doc/locusd/examples/realtime.conf does");
}

std::optional<std::string> keep_to_cpus(const std::vector<int>& cpus) {
  static const cpu_set_t kAtFirst = [] {
    cpu_set_t set;
    CPU_ZERO(&set);
    sched_getaffinity(0, sizeof(set), &set);
    return set;
  }();
  cpu_set_t set;
  CPU_ZERO(&set);
  for (const int cpu : cpus)
    CPU_SET(static_cast<std::size_t>(cpu), &set);
  if (sched_setaffinity(0, sizeof(set), cpus.empty() ? &kAtFirst : &set) == 0)
    return std::nullopt;
  return refused("realtime.cpus", "name processors that this machine has and the unit may use");
}

std::optional<std::string> raise_priority(int fifo_priority) {
  const sched_param wanted{fifo_priority};
  if (fifo_priority == 0 || sched_setscheduler(0, SCHED_FIFO, &wanted) == 0)
    return std::nullopt;
  return refused("realtime.priority", "grant it as /usr/share/doc/locusd/examples/realtime.conf does");
}

} // namespace locus::daemon
