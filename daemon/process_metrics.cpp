// SPDX-License-Identifier: Apache-2.0
#include "daemon/process_metrics.hpp"

#include <cstddef>
#include <cstdint>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <optional>
#include <sstream>
#include <string>
#include <system_error>

#include <unistd.h>

#include "daemon/machine_time.hpp"

namespace locus::daemon {
namespace {

/// Returns the start of the process on the wall clock, from field 22 of /proc/self/stat. Computed once: a clock step
/// does not change it.
double start_time_s() {
  static const double start_s = [] {
    std::string stat;
    std::getline(std::ifstream{"/proc/self/stat"}, stat);
    stat.erase(0, stat.rfind(')') + 2); // the program name may contain spaces
    constexpr int kStateToStart = 19;
    std::istringstream fields{stat};
    std::string skipped;
    for (int i = 0; i < kStateToStart; ++i)
      fields >> skipped;
    double ticks = 0;
    fields >> ticks;
    const double age_s = to_seconds(read_clock(CLOCK_BOOTTIME)) - ticks / static_cast<double>(sysconf(_SC_CLK_TCK));
    return to_seconds(read_clock(CLOCK_REALTIME)) - age_s;
  }();
  return start_s;
}

std::uint64_t resident_bytes() {
  std::ifstream statm{"/proc/self/statm"};
  std::uint64_t size = 0, resident = 0;
  statm >> size >> resident;
  return resident * static_cast<std::uint64_t>(sysconf(_SC_PAGESIZE));
}

/// Counts the open descriptors; empty if /proc cannot be read.
std::optional<std::size_t> open_files() {
  std::error_code error;
  std::size_t count = 0;
  for (std::filesystem::directory_iterator entry{"/proc/self/fd", error}, end; !error && entry != end;
       entry.increment(error))
    ++count;
  return error || count == 0 ? std::nullopt : std::optional{count - 1}; // excluding the folder's own
}

} // namespace

void add_process(MetricsText& text) {
  text.counter("process_cpu_seconds", "Processor time of all threads.");
  text.add(to_seconds(read_clock(CLOCK_PROCESS_CPUTIME_ID)));
  text.gauge("process_resident_memory_bytes", "Memory in use.");
  text.add(resident_bytes());
  text.gauge("process_open_fds", "Open file descriptors.");
  if (const auto files = open_files())
    text.add(*files);
  text.gauge("process_start_time_seconds", "Start of the process, since the Unix epoch.");
  text.add(start_time_s());
}

} // namespace locus::daemon
