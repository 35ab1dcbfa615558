// SPDX-License-Identifier: Apache-2.0
#include "daemon/service/service.hpp"

#include <array>
#include <csignal>
#include <span>
#include <thread>
#include <utility>
#include <variant>

#include <fmt/format.h>
#include <poll.h>
#include <sys/signalfd.h>
#include <systemd/sd-daemon.h>
#include <unistd.h>

#include "config/config_yaml.hpp"
#include "daemon/dds/dds_node.hpp"
#include "daemon/machine_time.hpp"
#include "daemon/service/machine.hpp"
#include "drivers/lidar_input.hpp"

namespace locus::daemon {

namespace {

constexpr Duration kTick = std::chrono::milliseconds{100};
constexpr Duration kAfterAnswers = std::chrono::milliseconds{50}; ///< or who asks without end has a core of ours
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
  Expected<Config, ConfigErrors> config = Config{};
  if (!file.empty())
    config = load_service_config(file);
  if (!config)
    return config;
  if (const auto lidars = LidarRouter::open(config->lidars); !lidars)
    return ConfigErrors{lidars.error()};
  return config;
}

Service::Service(std::filesystem::path config_file, Log& log)
    : config_file_(std::move(config_file)), log_(log), inherited_(inherited_sockets()), signals_(open_signals()) {
  set_dds_log([this](bool is_error, std::string_view line) {
    log_.say(is_error ? Severity::error : Severity::info, fmt::format("Cyclone DDS: {}", line));
  });
}

Service::~Service() { close(signals_); }

int Service::run(const Config& config) {
  if (const auto problem = begin(config, recent_state())) {
    log_.error(*problem);
    return 1;
  }
  auto control = ControlServer::open(control_path(), [this](const ControlRequest& request) { return answer(request); });
  if (control)
    control_ = std::move(*control);
  else
    log_.warn(control.error());
  sd_notify(0, "READY=1");
  for (bool wanted = true; wanted && session_;) {
    std::vector<pollfd> wait{{signals_, POLLIN, 0}};
    if (control_)
      control_->add_to(wait);
    const timespec tick = to_timespec(kTick);
    ppoll(wait.data(), wait.size(), &tick, nullptr);
    wanted = take_signal();
    if (wanted && control_ && control_->serve())
      std::this_thread::sleep_for(kAfterAnswers);
    look_after();
  }
  sd_notify(0, "STOPPING=1\nSTATUS=Stopping");
  if (!session_)
    return 1;
  watch_.reset();
  const std::optional<SavedState> state = session_->stop();
  session_.reset(); // with who else writes states
  keep_state(state);
  log_.info("stopped");
  return 0;
}

/// What another service left behind, if it can still be true.
std::optional<SavedState> Service::recent_state() {
  constexpr Duration kOldest = std::chrono::seconds{60};
  const auto file = state_path();
  if (!file || !std::filesystem::exists(*file))
    return std::nullopt;
  auto state = load_state(*file);
  if (!state) {
    log_.warn(fmt::format("a fresh start: {}", state.error()));
    return std::nullopt;
  }
  const Duration age = Stamp{read_clock(CLOCK_REALTIME)} - state->last.stamp;
  if (age < Duration::zero()) {
    log_.info("a fresh start: the saved state is newer than the clock; the clock was set back");
    return std::nullopt;
  }
  if (age > kOldest) {
    log_.info(fmt::format("a fresh start: the saved state is {:.0f} s old, more than {:.0f} s", to_seconds(age),
                          to_seconds(kOldest)));
    return std::nullopt;
  }
  return std::move(*state);
}

void Service::keep_state(const std::optional<SavedState>& state) {
  const auto file = state_path();
  if (!file || !state)
    return;
  if (const auto problem = write_state(*file, *state))
    log_.error(*problem);
}

std::optional<std::string> Service::begin(const Config& config, std::optional<SavedState> state) {
  watch_.reset();
  session_.reset();
  if (const auto problem = keep_to_cpus(config.realtime.cpus)) // as the threads to come do
    log_.warn(*problem);
  if (const auto problem = lock_memory(config.realtime.lock_memory))
    log_.warn(*problem);
  auto session = Session::start(config, inherited_, std::move(state), log_);
  if (!session)
    return session.error();
  session_ = std::move(*session);
  map_asked_.reset();
  watch_.emplace(*session_, log_);
  return std::nullopt;
}

ControlServer::Answer Service::reload() {
  using Answer = ControlServer::Answer;
  sd_notify(0, fmt::format("RELOADING=1\nMONOTONIC_USEC={}", read_clock(CLOCK_MONOTONIC).count() / 1000).c_str());
  Answer answer = Answer::done();
  if (const auto config = read_config(config_file_); !config)
    answer = Answer::wrong_usage(fmt::format("{}", fmt::join(config.error(), "; ")));
  else if (const auto problem = go_on_with(*config))
    answer = Answer::refusal(*problem);
  if (!answer.json.contains("error"))
    log_.info("reloaded");
  else
    log_.error(fmt::format("reload refused{}: {}", session_ ? ", the old configuration stays in force" : "",
                           answer.json["error"].get<std::string>()));
  if (session_)
    sd_notify(0, "READY=1");
  return answer;
}

/// The odometry goes on where it is. Where the new sockets cannot be had, with the old configuration: it had to let go
/// of its own, for they may be the same.
std::optional<std::string> Service::go_on_with(const Config& config) {
  const Config old = session_->config();
  const FlatGround mode = session_->flat_ground();
  const std::optional<SavedState> state = session_->stop();
  std::optional<SavedState> its_state = state;
  if (its_state)
    its_state->flat_ground = config.odometry.flat_ground;
  auto problem = begin(config, std::move(its_state));
  if (!problem)
    return std::nullopt;
  if (const auto old_problem = begin(old, state)) {
    *problem += "; the old configuration fails as well; the service stops: " + *old_problem;
    keep_state(state);
  } else {
    session_->set_flat_ground(mode);
  }
  return problem;
}

/// Whether the service is to go on. However many ask for a reload, it is one.
bool Service::take_signal() {
  signalfd_siginfo info{};
  bool is_to_reload = false;
  while (read(signals_, &info, sizeof(info)) == static_cast<ssize_t>(sizeof(info))) {
    if (info.ssi_signo != SIGHUP)
      return false;
    is_to_reload = true;
  }
  if (is_to_reload)
    reload();
  return true;
}

std::optional<ControlServer::Answer> Service::answer(const ControlRequest& request) {
  if (!session_) // another client's reload has ended it
    return ControlServer::Answer::refusal("the service ends; look at: journalctl -u locusd");
  return std::visit([this](const auto& one) { return answer(one); }, request);
}

std::optional<ControlServer::Answer> Service::answer(ShowStatus request) {
  const Figures figures = session_->figures();
  if (request.as_text)
    return ControlServer::Answer{{{"text", to_text(figures)}}, {}};
  return ControlServer::Answer{to_json(figures), {}};
}

std::optional<ControlServer::Answer> Service::answer(SetFlatGround request) {
  session_->set_flat_ground(request.mode);
  return ControlServer::Answer::done();
}

std::optional<ControlServer::Answer> Service::answer(const Reset& request) {
  if (const auto problem = session_->reset(request.T_odom_base))
    return ControlServer::Answer::refusal(*problem);
  return ControlServer::Answer::done();
}

std::optional<ControlServer::Answer> Service::answer(Reload /*request*/) { return reload(); }

/// The points of the map as they lie in memory. Nothing until the odometry thread has brought them. One that comes
/// after nobody waits for it any more is of another time.
std::optional<ControlServer::Answer> Service::answer(SaveMap /*request*/) {
  const Duration now = read_clock(CLOCK_MONOTONIC);
  if (!map_asked_ || now - *map_asked_ > ControlServer::kLongestAnswer) {
    session_->request_map();
    map_asked_ = now;
  }
  const std::vector<SurfacePoint>* const points = session_->take_map();
  if (points == nullptr)
    return std::nullopt;
  map_asked_.reset();
  const auto bytes = std::as_bytes(std::span(*points));
  return ControlServer::Answer{{{"points", points->size()}}, {bytes.begin(), bytes.end()}};
}

void Service::look_after() {
  if (!session_)
    return;
  const Figures figures = session_->figures();
  watch_->look(figures);
  watchdog_.look(*session_);
  const auto& last = figures.sweeps.last;
  const std::optional<TrackingState> state = last ? std::optional{last->state} : std::nullopt;
  const Duration now = read_clock(CLOCK_MONOTONIC);
  if (state == told_state_ && now - told_ < kTellEvery)
    return;
  told_state_ = state;
  told_ = now;
  sd_notify(0, fmt::format("STATUS={}", status_line(figures)).c_str());
  session_->link().publish(DiagnosticsMessage(diagnostics(figures), Stamp{read_clock(CLOCK_REALTIME)}));
}

} // namespace locus::daemon
