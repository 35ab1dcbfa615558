// SPDX-License-Identifier: Apache-2.0
#include "daemon/service/service.hpp"

#include <csignal>
#include <utility>

#include <fmt/format.h>
#include <poll.h>
#include <sys/signalfd.h>
#include <systemd/sd-daemon.h>
#include <unistd.h>

#include "config/config_yaml.hpp"
#include "daemon/dds/dds_node.hpp"
#include "daemon/machine_time.hpp"
#include "daemon/service/lidar_sockets.hpp"
#include "daemon/service/realtime.hpp"
#include "daemon/service/status.hpp"

namespace locus::daemon {

namespace {

constexpr Duration kTick = std::chrono::milliseconds{100};
constexpr Duration kTellEvery = std::chrono::seconds{1};

/// Blocked before the first thread is made, so that none of them ever takes one.
int open_signals() {
  sigset_t set;
  sigemptyset(&set);
  for (const int number : {SIGTERM, SIGINT, SIGHUP})
    sigaddset(&set, number);
  pthread_sigmask(SIG_BLOCK, &set, nullptr);
  return signalfd(-1, &set, SFD_NONBLOCK | SFD_CLOEXEC);
}

} // namespace

Expected<Config, ConfigErrors> read_config(const std::filesystem::path& file) {
  if (file.empty())
    return Config{};
  return load_config(file);
}

Service::Service(std::filesystem::path config_file, Log& log)
    : config_file_(std::move(config_file)), log_(log), inherited_(inherited_sockets()), signals_(open_signals()) {
  set_dds_log([this](bool is_error, std::string_view line) {
    log_.say(is_error ? Severity::error : Severity::info, fmt::format("Cyclone DDS: {}", line));
  });
}

Service::~Service() { close(signals_); }

int Service::run(const Config& config) {
  if (const auto problem = keep_to_cpus(config.realtime.cpus))
    log_.warn(*problem);
  if (const auto problem = config.realtime.lock_memory ? lock_memory() : std::nullopt)
    log_.warn(*problem);
  if (!begin(config))
    return 1;
  sd_notify(0, "READY=1");
  for (bool wanted = true; wanted;) {
    pollfd wait{signals_, POLLIN, 0};
    const timespec tick = to_timespec(kTick);
    ppoll(&wait, 1, &tick, nullptr);
    wanted = take_signal();
    look_after();
  }
  sd_notify(0, "STOPPING=1\nSTATUS=Stopping");
  watch_.reset();
  session_.reset();
  log_.info("stopped");
  return 0;
}

bool Service::begin(const Config& config) {
  watch_.reset();
  session_.reset();
  auto session = Session::start(config, inherited_, log_);
  if (!session) {
    log_.error(session.error());
    return false;
  }
  session_ = std::move(*session);
  watch_.emplace(*session_, log_);
  return true;
}

std::optional<std::string> Service::reload() {
  sd_notify(0, fmt::format("RELOADING=1\nMONOTONIC_USEC={}", read_clock(CLOCK_MONOTONIC).count() / 1000).c_str());
  std::optional<std::string> problem;
  const auto config = read_config(config_file_);
  const Config old = session_->config();
  if (!config)
    problem = fmt::format("{}", fmt::join(config.error(), "; "));
  else if (!begin(*config))
    problem = begin(old) ? "the sockets of the new configuration cannot be opened" : "neither can be opened";
  if (problem)
    log_.error(fmt::format("reload refused, the old configuration stays in force: {}", *problem));
  else
    log_.info("reloaded");
  sd_notify(0, "READY=1");
  return problem;
}

/// Whether the service is to go on.
bool Service::take_signal() {
  signalfd_siginfo info{};
  while (read(signals_, &info, sizeof(info)) == static_cast<ssize_t>(sizeof(info))) {
    if (info.ssi_signo != SIGHUP)
      return false;
    if (reload() && !session_)
      return false;
  }
  return true;
}

void Service::look_after() {
  if (!session_)
    return;
  watch_->look();
  watchdog_.look(*session_);
  const auto last = session_->figures().snapshot().last;
  const std::optional<TrackingState> state = last ? std::optional{last->state} : std::nullopt;
  const Duration now = read_clock(CLOCK_MONOTONIC);
  if (state == told_state_ && now - told_ < kTellEvery)
    return;
  told_state_ = state;
  told_ = now;
  tell_world();
}

void Service::tell_world() {
  sd_notify(0, fmt::format("STATUS={}", status_line(*session_)).c_str());
  session_->link().publish(DiagnosticsMessage(diagnostics(*session_), Stamp{read_clock(CLOCK_REALTIME)}));
}

} // namespace locus::daemon
