// SPDX-License-Identifier: Apache-2.0
#include "daemon/service/service.hpp"

#include <array>
#include <csignal>
#include <span>
#include <thread>
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
  if (!begin(config, recent_state()))
    return 1;
  auto control = ControlServer::open(control_path(), [this](const nlohmann::json& request) { return answer(request); });
  if (control)
    control_ = std::move(*control);
  else
    log_.warn(control.error());
  sd_notify(0, "READY=1");
  for (bool wanted = true; wanted;) {
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
  watch_.reset();
  if (session_)
    keep_state(session_->stop());
  session_.reset();
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
  if (age < Duration::zero() || age > kOldest) {
    log_.info(fmt::format("a fresh start: the saved state is {:.0f} s old, more than {:.0f} s", to_seconds(age),
                          to_seconds(kOldest)));
    return std::nullopt;
  }
  return std::move(*state);
}

void Service::keep_state(std::optional<SavedState> state) {
  const auto file = state_path();
  if (!file || !state)
    return;
  if (const auto problem = write_state(*file, *state))
    log_.error(*problem);
}

bool Service::begin(const Config& config, std::optional<SavedState> state) {
  watch_.reset();
  session_.reset();
  auto session = Session::start(config, inherited_, std::move(state), log_);
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
  if (!config) {
    problem = fmt::format("{}", fmt::join(config.error(), "; "));
  } else {
    std::optional<SavedState> state = session_->stop();
    if (state)
      state->flat_ground = config->odometry.flat_ground;
    if (!begin(*config, state))
      problem =
          begin(old, state) ? "its sockets cannot be opened" : "its sockets cannot be opened, nor can the old ones";
  }
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

std::optional<ControlServer::Answer> Service::answer(const nlohmann::json& request) {
  using Answer = ControlServer::Answer;
  const auto done = [] { return Answer{{{"done", true}}, {}}; };
  const auto refused = [](const std::string& why) { return Answer{{{"error", why}}, {}}; };
  const std::string command = request["command"];
  if (command == "status")
    return Answer{status_json(*session_), {}};
  if (command == "save-map")
    return answer_map();
  if (command == "flat-ground") {
    const std::string mode = request["mode"];
    if (mode != "on" && mode != "off" && mode != "auto")
      return refused("flat-ground must be on, off or auto");
    session_->set_flat_ground(mode == "on" ? FlatGround::on : mode == "off" ? FlatGround::off : FlatGround::automatic);
    return done();
  }
  if (command == "reset") {
    std::optional<Pose> T_odom_base;
    if (request.contains("pose")) {
      const auto v = request["pose"].get<std::array<double, 6>>();
      T_odom_base = Pose{from_rpy_rad(Eigen::Vector3d{v[3], v[4], v[5]} * kRadPerDeg), {v[0], v[1], v[2]}};
    }
    session_->reset(T_odom_base);
    return done();
  }
  if (command == "reload") {
    const auto problem = reload();
    return problem ? refused(*problem) : done();
  }
  return refused(fmt::format("unknown command {}; use locusctl of the same version", command));
}

/// The points of the map as they lie in memory. Nothing until the odometry thread has brought them.
std::optional<ControlServer::Answer> Service::answer_map() {
  if (!std::exchange(map_asked_, true))
    session_->request_map();
  const std::vector<SurfacePoint>* const points = session_->take_map();
  if (points == nullptr)
    return std::nullopt;
  map_asked_ = false;
  const auto bytes = std::as_bytes(std::span(*points));
  return ControlServer::Answer{{{"points", points->size()}}, {bytes.begin(), bytes.end()}};
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
