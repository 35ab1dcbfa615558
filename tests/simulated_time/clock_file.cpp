// SPDX-License-Identifier: Apache-2.0
#include "simulated_time/clock_file.hpp"

#include <cstdlib>
#include <ctime>
#include <fstream>
#include <stdexcept>

#include <fcntl.h>
#include <sched.h>
#include <sys/mman.h>
#include <sys/syscall.h>
#include <unistd.h>

namespace locus::test {
namespace {

constexpr const char* kVariable = "SIMULATED_CLOCK";

Duration system_clock(clockid_t clock) {
  timespec time{};
  syscall(SYS_clock_gettime, clock, &time);
  return std::chrono::seconds{time.tv_sec} + Duration{time.tv_nsec};
}

} // namespace

Duration system_time() { return system_clock(CLOCK_MONOTONIC); }

void run_in_simulated_time(char** argv, double rate) {
  if (std::getenv(kVariable) != nullptr) // NOLINT(concurrency-mt-unsafe)
    return;
  const Duration origin = system_time();
  const SimulatedTime time{0, rate, origin.count(), (system_clock(CLOCK_REALTIME) - origin).count(),
                           (system_clock(CLOCK_BOOTTIME) - origin).count()};
  const int file = memfd_create("simulated_clock", 0); // without O_CLOEXEC: inherited by child programs
  if (file < 0 || write(file, &time, sizeof(time)) != static_cast<ssize_t>(sizeof(time)))
    throw std::runtime_error("no file for the simulated clock");
  const std::string path = "/proc/" + std::to_string(getpid()) + "/fd/" + std::to_string(file);
  const sched_param fifo{3}; // real-time: delays by other processes would be multiplied by the rate
  sched_setscheduler(0, SCHED_FIFO, &fifo);
  setenv(kVariable, path.c_str(), 1);               // NOLINT(concurrency-mt-unsafe)
  setenv("LD_PRELOAD", SIMULATED_CLOCK_LIBRARY, 1); // NOLINT(concurrency-mt-unsafe)
  execv("/proc/self/exe", argv);
  throw std::runtime_error("this program cannot be restarted");
}

ClockFile::ClockFile() {
  const int file = open(std::getenv(kVariable), O_RDWR | O_CLOEXEC); // NOLINT(concurrency-mt-unsafe)
  page_ = mmap(nullptr, sizeof(SimulatedTime), PROT_READ | PROT_WRITE, MAP_SHARED, file, 0);
  close(file);
  if (page_ == MAP_FAILED)
    throw std::runtime_error("no simulated clock");
  time_ = static_cast<volatile SimulatedTime*>(page_);
}

ClockFile::~ClockFile() { munmap(page_, sizeof(SimulatedTime)); }

void ClockFile::step(Duration by) { time_->set_by_ns = time_->set_by_ns + by.count(); }

} // namespace locus::test
