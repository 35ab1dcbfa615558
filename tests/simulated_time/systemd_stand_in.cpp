// SPDX-License-Identifier: Apache-2.0
#include "simulated_time/systemd_stand_in.hpp"

#include <csignal>
#include <utility>

#include "daemon/machine_time.hpp"

namespace locus::test {
namespace {

constexpr Duration kWatchdog = std::chrono::seconds{5};
constexpr Duration kRestartAfter = std::chrono::milliseconds{500};
constexpr Duration kRound = std::chrono::milliseconds{100};

} // namespace

SystemdStandIn::SystemdStandIn(std::vector<std::string> command, const std::filesystem::path& notify_socket)
    : command_(std::move(command)), notify_(notify_socket) {
  setenv("WATCHDOG_USEC", "5000000", 1); // NOLINT(concurrency-mt-unsafe): before any thread
  thread_ = std::thread([this] { run(); });
}

SystemdStandIn::~SystemdStandIn() {
  stopping_ = true;
  thread_.join();
}

bool SystemdStandIn::signal(int number) {
  const std::scoped_lock lock(mutex_);
  if (service_ != nullptr)
    service_->signal(number);
  return service_ != nullptr;
}

std::optional<SystemdStandIn::Life> SystemdStandIn::life() const {
  const std::scoped_lock lock(mutex_);
  return service_ != nullptr ? std::optional{life_} : std::nullopt;
}

std::vector<std::string> SystemdStandIn::new_lines() {
  const std::scoped_lock lock(mutex_);
  if (service_ != nullptr)
    take_lines(*service_);
  return std::exchange(lines_, {});
}

void SystemdStandIn::take_lines(const Child& service) {
  const std::vector<std::string> all = service.lines();
  lines_.insert(lines_.end(), all.begin() + static_cast<std::ptrdiff_t>(lines_taken_), all.end());
  lines_taken_ = all.size();
}

void SystemdStandIn::run() {
  while (!stopping_) {
    Child service(command_);
    {
      const std::scoped_lock lock(mutex_);
      service_ = &service;
      life_ = {life_.number + 1, service.pid(), daemon::read_clock(CLOCK_MONOTONIC)};
      lines_taken_ = 0;
    }
    live(service);
    std::this_thread::sleep_for(kRestartAfter);
  }
}

/// Runs the service until it exits, or until the watchdog kills it.
void SystemdStandIn::live(Child& service) {
  Duration fed = daemon::read_clock(CLOCK_MONOTONIC);
  while (!stopping_) {
    const bool feeds = notify_.hears("WATCHDOG=1", kRound);
    const Duration now = daemon::read_clock(CLOCK_MONOTONIC);
    fed = feeds ? now : fed;
    if (now - fed > kWatchdog) {
      ++watchdog_kills_;
      fed = now;
      service.signal(SIGKILL); // SIGABRT does not end a stopped process
    }
    const std::scoped_lock lock(mutex_);
    if (const auto status = service.wait_for_exit(Duration::zero())) {
      take_lines(service);
      lines_.push_back("exit " + std::to_string(*status));
      service_ = nullptr;
      return;
    }
  }
  const std::scoped_lock lock(mutex_);
  service_ = nullptr;
}

} // namespace locus::test
