// SPDX-License-Identifier: Apache-2.0
#include "daemon/service/service.hpp"

#include <algorithm>
#include <csignal>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <poll.h>
#include <sys/signalfd.h>
#include <systemd/sd-daemon.h>
#include <unistd.h>

#include "config/config_yaml.hpp"
#include "config/lidar_metadata.hpp"
#include "daemon/dds/dds_node.hpp"
#include "daemon/dds/diagnostics.hpp"
#include "daemon/machine_time.hpp"
#include "daemon/service/machine.hpp"
#include "daemon/service/run_mark.hpp"
#include "drivers/lidar_router.hpp"

namespace locus::daemon {

namespace {

constexpr Duration kTick = std::chrono::milliseconds{100};
constexpr Duration kPauseAfterAnswers = std::chrono::milliseconds{50}; ///< limits clients to 20 rounds of requests/s
constexpr Duration kReportPeriod = std::chrono::seconds{1};

/// Blocks the signals before the first thread is created, so that they are delivered through the descriptor only.
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
  return with_lidar_metadata(std::move(*config));
}

Service::Service(std::filesystem::path config_file, Log& log)
    : config_file_(std::move(config_file)), log_(log), inherited_(inherited_sockets()), signals_(open_signals()) {
  set_dds_log([this](bool is_error, std::string_view line) {
    log_.write(is_error ? Severity::error : Severity::info, fmt::format("Cyclone DDS: {}", line));
  });
}

Service::~Service() { close(signals_); }

int Service::run(const Config& config) {
  open_control();
  if (const auto file = state_path(); file && control_)
    incidents_.emplace(file->parent_path() / "incidents");
  std::optional<SavedState> state = recent_state();
  store_crashed_run(config, state);
  if (const auto problem = begin(config, std::move(state))) {
    log_.error(*problem);
    finish_incident(); // lost otherwise, since the process ends here
    return 1;
  }
  sd_notify(0, "READY=1");
  for (bool wanted = true; wanted && session_;) {
    std::vector<pollfd> wait{{signals_, POLLIN, 0}};
    if (control_)
      control_->add_to(wait);
    if (metrics_)
      metrics_->add_to(wait);
    const timespec tick = to_timespec(kTick);
    ppoll(wait.data(), wait.size(), &tick, nullptr);
    wanted = handle_signals();
    const bool has_answered = wanted && control_ && control_->serve();
    const bool has_served = wanted && session_ && metrics_ && metrics_->serve();
    if (has_answered || has_served)
      std::this_thread::sleep_for(kPauseAfterAnswers);
    supervise();
    follow_address();
  }
  sd_notify(0, "STOPPING=1\nSTATUS=Stopping");
  if (!session_)
    return 1;
  monitor_.reset();
  const std::optional<SavedState> last = session_->stop();
  const std::string run = summary_line(session_->figures());
  session_.reset(); // ends the other writer of states
  save_state(last);
  finish_incident();
  if (control_)
    remove_mark_and_ring();
  log_.info("stopped: " + run);
  return 0;
}

/// Opens the control socket before any other access to its folder, which belongs to the owner of the socket.
void Service::open_control() {
  auto control = ControlServer::open(control_path(), [this](const ControlRequest& request) { return answer(request); });
  if (control)
    control_ = std::move(*control);
  else
    log_.warn(control.error());
}

/// Loads the state of an earlier service and marks whether its pose may still be valid.
std::optional<SavedState> Service::recent_state() {
  constexpr Duration kMaxAge = std::chrono::seconds{60};
  const auto file = state_path();
  if (!file || !std::filesystem::exists(*file))
    return std::nullopt;
  auto state = load_state(*file);
  if (!state) {
    log_.warn(fmt::format("starting without a saved state: {}", state.error()));
    return std::nullopt;
  }
  const Duration age = Stamp{read_clock(CLOCK_REALTIME)} - state->last.stamp;
  state->is_recent = age >= Duration::zero() && age <= kMaxAge;
  if (age < Duration::zero())
    log_.info("starting without the saved pose: it is newer than the clock, which was set back");
  if (age > kMaxAge)
    log_.info(fmt::format("starting without the saved pose: it is {:.0f} s old, more than {:.0f} s", to_seconds(age),
                          to_seconds(kMaxAge)));
  return std::move(*state);
}

void Service::save_state(const std::optional<SavedState>& state) {
  const auto file = state_path();
  if (!file || !state)
    return;
  if (const auto problem = write_state(*file, *state))
    log_.error(*problem);
}

/// Stores the input of a crashed run as an incident; a run that ended cleanly has left no mark.
void Service::store_crashed_run(const Config& config, const std::optional<SavedState>& state) {
  if (!incidents_)
    return;
  std::error_code ignored;
  for (const auto& folder : {ring_folder(), record_folder(config.record.folder)})
    std::filesystem::remove_all(snapshot_in(folder), ignored); // incomplete when the run ended
  const auto run = consume_mark();
  if (!run || config.record.keep_s == 0)
    return;
  const Duration keep = from_seconds(config.record.keep_s);
  const Stamp now{read_clock(CLOCK_REALTIME)};
  std::vector<std::filesystem::path> pieces = last_pieces(*run, keep);
  if (pieces.empty())
    return;
  const auto pose = state && state->is_recent ? std::optional{state->last.T_odom_base} : std::nullopt;
  if (!incidents_->raise({IncidentCause::restart, keep, now, restart_report(now, *run, pose), std::move(pieces)}))
    log_.warn(fmt::format("the previous run crashed less than five minutes after another: no incident is stored; its "
                          "input remains in {} until this service stops",
                          run->string()));
}

std::optional<std::string> Service::begin(const Config& config, std::optional<SavedState> state) {
  monitor_.reset();
  session_.reset();
  if (const auto problem = set_cpu_affinity(config.realtime.cpus)) // inherited by the new threads
    log_.warn(*problem);
  if (const auto problem = lock_memory(config.realtime.lock_memory))
    log_.warn(*problem);
  if (incidents_)
    incidents_->set_max_bytes(config.record.incidents_bytes);
  Incidents* const incidents = incidents_ ? &*incidents_ : nullptr;
  auto session = Session::start(config, inherited_, std::move(state), incidents, resets_, log_);
  if (!session)
    return session.error();
  session_ = std::move(*session);
  dds_address_.reset();
  map_requested_at_.reset();
  monitor_.emplace(session_->config(), session_->input().sockets(), log_);
  serve_metrics(config.metrics.listen);
  return std::nullopt;
}

/// Starts the metrics server. A reload retries after a failure.
void Service::serve_metrics(const std::string& address) {
  if (metrics_ && address == metrics_address_)
    return;
  metrics_.reset();
  metrics_address_ = address;
  if (address.empty())
    return;
  auto server = MetricsServer::open(address, [this] { return to_open_metrics(session_->figures()); });
  if (!server)
    return log_.warn(server.error());
  metrics_ = std::move(*server);
  log_.info(fmt::format("metrics are served at {}", address));
}

ControlServer::Answer Service::reload() {
  using Answer = ControlServer::Answer;
  sd_notify(0, fmt::format("RELOADING=1\nMONOTONIC_USEC={}", read_clock(CLOCK_MONOTONIC).count() / 1000).c_str());
  Answer answer = Answer::done();
  if (const auto config = read_config(config_file_); !config)
    answer = Answer::wrong_usage(fmt::format("{}", fmt::join(config.error(), "; ")));
  else if (const auto problem = restart_with(*config))
    answer = Answer::refusal(*problem);
  if (!answer.json.contains("error"))
    log_.info("reloaded");
  else
    log_.error(fmt::format("reload rejected{}: {}", session_ ? ", the old configuration remains in effect" : "",
                           answer.json["error"].get<std::string>()));
  if (session_)
    sd_notify(0, "READY=1");
  return answer;
}

/// Restarts the session with `config` at the current pose. If that fails, restarts it with the old configuration: its
/// sockets had to be closed first, since the new ones may be the same.
std::optional<std::string> Service::restart_with(const Config& config) {
  const Config old = session_->config();
  const FlatGround mode = session_->flat_ground();
  const std::optional<SavedState> state = session_->stop();
  log_.info("run ended: " + summary_line(session_->figures()));
  std::optional<SavedState> new_state = state;
  if (new_state)
    new_state->flat_ground = config.odometry.flat_ground;
  auto problem = begin(config, std::move(new_state));
  if (!problem)
    return std::nullopt;
  if (const auto old_problem = begin(old, state)) {
    *problem += "; the old configuration fails as well; the service stops: " + *old_problem;
    save_state(state);
  } else {
    session_->set_flat_ground(mode);
  }
  return problem;
}

/// Handles pending signals; false if the service is to stop. Several SIGHUP cause one reload.
bool Service::handle_signals() {
  signalfd_siginfo info{};
  bool reload_requested = false;
  while (read(signals_, &info, sizeof(info)) == static_cast<ssize_t>(sizeof(info))) {
    if (info.ssi_signo != SIGHUP)
      return false;
    reload_requested = true;
  }
  if (reload_requested)
    reload();
  return true;
}

/// Completes the incident being written, within kPatience.
void Service::finish_incident() {
  constexpr Duration kPatience = std::chrono::seconds{2};
  const Duration end = read_clock(CLOCK_MONOTONIC) + kPatience;
  while (incidents_ && !incidents_->status().writing.empty() && read_clock(CLOCK_MONOTONIC) < end)
    incidents_->work(nullptr);
}

void Service::check_for_incidents(const Figures& figures) {
  const auto cause = incident_watch_.check(figures);
  const Stamp now{read_clock(CLOCK_REALTIME)};
  if (cause)
    incidents_->raise({*cause, from_seconds(figures.config.record.keep_s), now, incident_report(*cause, now, figures)});
  const Incidents::Status& incidents = *figures.live->incidents;
  if (!incidents.problem.empty() && incidents.problem != logged_incidents_.problem)
    log_.error(fmt::format("{}; the odometry continues", incidents.problem));
  if (!incidents.refusal.empty() && incidents.refusal != logged_incidents_.refusal)
    log_.warn(incidents.refusal);
  if (incidents.stored != logged_incidents_.stored)
    log_.write(Severity::notice, fmt::format("the latest input is stored in {}", incidents.last.string()));
  logged_incidents_ = incidents;
}

/// Restarts the session if the interface of DDS has lost the address at which DDS connected: a participant announces
/// that one until its end, so no reader would be matched any more.
void Service::follow_address() {
  constexpr Duration kPeriod = std::chrono::seconds{1};
  const Duration now = read_clock(CLOCK_MONOTONIC);
  if (!session_ || now - address_checked_at_ < kPeriod || !session_->link().status().connected)
    return;
  address_checked_at_ = now;
  const Config config = session_->config();
  const std::vector<std::string> addresses = addresses_of(config.dds.interface);
  if (addresses.empty()) // the old one may come back
    return;
  dds_address_ = dds_address_.value_or(addresses.front());
  if (std::ranges::find(addresses, *dds_address_) != addresses.end())
    return;
  log_.warn(fmt::format("the address of {} changed from {} to {}: DDS is started again, and the odometry continues",
                        config.dds.interface, *dds_address_, addresses.front()));
  if (const auto problem = restart_with(config))
    log_.error(*problem);
}

void Service::supervise() {
  if (!session_)
    return;
  const Figures figures = session_->figures();
  monitor_->check(figures);
  if (figures.live->incidents)
    check_for_incidents(figures);
  watchdog_.feed(*session_);
  const auto& last = figures.sweeps.last;
  const std::optional<TrackingState> state = last ? std::optional{last->state} : std::nullopt;
  const Duration now = read_clock(CLOCK_MONOTONIC);
  if (state == reported_state_ && now - reported_at_ < kReportPeriod)
    return;
  reported_state_ = state;
  reported_at_ = now;
  sd_notify(0, fmt::format("STATUS={}", status_line(figures)).c_str());
  const Stamp stamp{read_clock(CLOCK_REALTIME)};
  session_->link().publish(DiagnosticsMessage(diagnostics(figures, stamp), stamp));
}

} // namespace locus::daemon
