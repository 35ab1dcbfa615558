// SPDX-License-Identifier: Apache-2.0
#include "daemon/service/session.hpp"

#include <array>
#include <string_view>
#include <utility>
#include <variant>

#include <fmt/format.h>
#include <pthread.h>

#include "daemon/machine_time.hpp"
#include "daemon/service/machine.hpp"

namespace locus::daemon {

namespace {

constexpr Duration kDiskRound = std::chrono::milliseconds{100}; ///< between two looks for what is to be written

OdometryReport report_of(const OdometryEstimate& e) {
  return {e.stamp, e.T_odom_base, e.pose_covariance, e.twist_base, e.twist_covariance};
}

OdometryReport report_of(const FastSample& s) {
  return {s.stamp, s.T_odom_base, s.pose_covariance, s.twist_base, s.twist_covariance};
}

/// Without a state directory a relative one lies where the service was started.
std::filesystem::path record_folder(const std::filesystem::path& folder) {
  const auto state = state_path();
  return state ? state->parent_path() / folder : folder;
}

} // namespace

Expected<std::unique_ptr<Session>, std::string> Session::start(const Config& config, std::span<const int> inherited,
                                                               std::optional<SavedState> state, Log& log) {
  auto lidars = LidarRouter::open(config.lidars);
  if (!lidars)
    return lidars.error();
  auto sockets = open_lidar_sockets(config, inherited, log);
  if (!sockets)
    return sockets.error();
  return std::unique_ptr<Session>(new Session(config, std::move(*lidars), std::move(*sockets), std::move(state), log));
}

Session::Session(const Config& config, LidarRouter lidars, std::vector<UdpSocket> sockets,
                 std::optional<SavedState> state, Log& log)
    : config_(config), log_(log), started_(MachineTime::now()), input_(std::move(sockets)),
      flat_ground_(state ? state->flat_ground : config.odometry.flat_ground),
      link_(config, [this](const RosInput& input) { receive(input); }), clouds_(config.dds, link_),
      start_(std::move(state)),
      state_(state_path(), config.motion_sources, [this](const std::string& problem) { log_.error(problem); }) {
  // NOLINTNEXTLINE(cppcoreguidelines-prefer-member-initializer): stands after its like
  if (start_ && start_->sources != id_of(config_.motion_sources))
    start_->last.T_source_base = {};
  has_past_ = start_.has_value() && !start_->map_odom.empty();
  begin(std::move(lidars));
}

Session::~Session() { end(); }

void Session::begin(LidarRouter lidars) {
  LiveOptions options;
  if (start_)
    options.start = {start_->last, start_->map_odom};
  options.on_thread_start = [this] {
    if (const auto problem = raise_priority(config_.realtime.priority))
      log_.warn(*problem);
    if (!scheduling_told_.exchange(true))
      log_.info("runs with " + scheduling());
  };
  options.after_estimate = [this](const Sweep& sweep, const Odometry& odometry, const OdometryEstimate& estimate) {
    after(sweep, odometry, estimate);
  };
  InputSource& input = begin_recording();
  disk_.emplace(
      "disk", kDiskRound,
      [this](bool last) {
        state_.write();
        if (recorder_)
          recorder_->write(last);
      },
      [] { take_least_priority(); });
  const std::scoped_lock lock(pipeline_mutex_);
  pipeline_ = std::make_unique<LivePipeline>(config_, std::move(lidars), input, std::move(options));
  pipeline_->set_flat_ground(flat_ground());
  stopping_.store(false, std::memory_order_relaxed);
  publisher_ = std::thread([this] { publish(); });
  pthread_setname_np(publisher_.native_handle(), "publisher");
}

/// A run is what one life of the odometry has taken: its replay gives the same poses.
InputSource& Session::begin_recording() {
  if (config_.record.folder.empty())
    return input_;
  recorder_.reset(); // of the life before, whose pipeline is at rest
  const auto files = sample_files(config_);
  for (std::size_t i = 0; i < files.size(); ++i)
    if (!files[i])
      log_.warn(fmt::format("motion source {}: is not recorded, for a recording holds one IMU; the first one is",
                            config_.motion_sources[i].name));
  recorder_ = std::make_unique<Recorder>(record_folder(config_.record.folder), config_);
  return recording_input_.emplace(input_, *recorder_);
}

void Session::end() {
  stopping_.store(true, std::memory_order_relaxed);
  if (publisher_.joinable())
    publisher_.join();
  pipeline_->stop();
  disk_.reset();
}

/// With what it tells of times as everybody else on this host tells them.
OdometryEstimate Session::on_the_wall(const OdometryEstimate& estimate) const {
  OdometryEstimate told = estimate;
  told.stamp = input_.time().wall(estimate.stamp);
  for (SourceReport& source : told.sources)
    if (source.last_used != Stamp{})
      source.last_used = input_.time().wall(source.last_used);
  return told;
}

/// In the odometry thread, when the estimate has left.
void Session::after(const Sweep& sweep, const Odometry& odometry, const OdometryEstimate& steady_estimate) {
  const OdometryEstimate estimate = on_the_wall(steady_estimate);
  if (estimate.beginning)
    start_.reset();
  clouds_.take(sweep, odometry, estimate);
  state_.take(odometry, estimate, flat_ground());
  const std::uint64_t wanted = map_wanted_.load(std::memory_order_relaxed);
  if (wanted == map_answered_)
    return;
  map_answered_ = wanted;
  map_.back().request = wanted;
  read_planes(odometry.map().fine(), map_.back().points);
  static_cast<void>(map_.publish());
}

const std::vector<SurfacePoint>* Session::take_map() {
  const Map* const map = map_.take();
  return map != nullptr && map->request == map_wanted_.load(std::memory_order_relaxed) ? &map->points : nullptr;
}

std::optional<std::string> Session::reset(std::optional<Pose> T_odom_base) {
  auto lidars = LidarRouter::open(config_.lidars);
  if (!lidars)
    return lidars.error();
  end();
  start_.reset();
  if (T_odom_base)
    start_ = {{Stamp{read_clock(CLOCK_REALTIME)}, *T_odom_base}, flat_ground(), {}};
  state_.begin_anew(start_);
  has_past_ = announced_ = false;
  announcement_.reset();
  begin(std::move(*lidars));
  log_.info("odometry begins anew, as it was told to");
  return std::nullopt;
}

std::optional<SavedState> Session::stop() {
  end();
  if (!state_.now()) {
    if (start_)
      start_->flat_ground = flat_ground();
    return std::move(start_);
  }
  SavedState state{*state_.now(), flat_ground(), {}, id_of(config_.motion_sources)};
  read_map(pipeline_->processor().odometry(), state.last.T_odom_base, state.map_odom);
  return state;
}

void Session::receive(const RosInput& input) {
  if (const auto* word = std::get_if<FlatGroundWord>(&input))
    take(*word);
  else if (const auto* imu = std::get_if<ImuInput>(&input))
    input_.push(*imu);
  else if (const auto* odometry = std::get_if<OdometryInput>(&input))
    input_.push(*odometry);
  else
    input_.push(std::get<OutsideVerdict>(input));
}

/// At most one change a second: a topic that flutters does not flutter the odometry.
void Session::take(FlatGroundWord word) {
  constexpr Duration kLeastPause = std::chrono::seconds{1};
  const FlatGround wanted = word.flat ? FlatGround::on : FlatGround::off;
  const Duration now = read_clock(CLOCK_MONOTONIC);
  if (wanted == flat_ground() || now - flat_ground_changed_ < kLeastPause)
    return;
  flat_ground_changed_ = now;
  set_flat_ground(wanted);
  log_.info(fmt::format("flat ground is {}, as {} says", word.flat ? "on" : "off", config_.dds.flat_ground_topic));
}

void Session::set_flat_ground(FlatGround mode) {
  flat_ground_.store(mode, std::memory_order_relaxed);
  const std::scoped_lock lock(pipeline_mutex_);
  if (pipeline_)
    pipeline_->set_flat_ground(mode);
}

void Session::publish() {
  while (!stopping_.load(std::memory_order_relaxed)) {
    publisher_progress_.fetch_add(1, std::memory_order_relaxed);
    tell_of_clock();
    if (const auto done = pipeline_->next(std::chrono::milliseconds{50}))
      publish(*done);
    while (auto sample = pipeline_->next_fast()) {
      sample->stamp = input_.time().wall(sample->stamp);
      link_.publish_fast(report_of(*sample));
    }
    while (const auto event = pipeline_->next_health_event())
      tell(*event);
    if (const IngestReport* report = pipeline_->next_report()) {
      const std::scoped_lock lock(told_mutex_);
      told_.ingest = *report;
    }
  }
}

void Session::tell_of_clock() {
  const Duration set_by = input_.time().set_by();
  if (const Duration change = set_by - std::exchange(told_clock_set_by_, set_by); change != Duration::zero())
    log_.info(
        fmt::format("the clock of this computer was set by {:+.3f} s; the odometry goes on, and its stamps follow "
                    "the clock",
                    to_seconds(change)));
}

void Session::publish(const ProcessedSweep& done) {
  const OdometryEstimate estimate = on_the_wall(done.estimate);
  const bool is_published = link_.publish(report_of(estimate), estimate.state);
  {
    const std::scoped_lock lock(told_mutex_);
    told_.sweeps.take(done);
    told_.unpublished += is_published ? 0 : 1;
  }
  if (estimate.beginning && !announced_)
    announce(estimate);
  if (announcement_ && link_.publish_beginning(DiagnosticsMessage({*announcement_}, estimate.stamp)))
    announcement_.reset();
  tell(estimate.state);
}

/// A frame that begins anew is no surprise to who knows it.
void Session::announce(const OdometryEstimate& estimate) {
  announced_ = true;
  const Beginning from = *estimate.beginning;
  const bool is_lost = has_past_ && from != Beginning::map;
  const std::string text = from == Beginning::map    ? "resumed where the service ended"
                           : from == Beginning::told ? "begins where it was told to"
                           : from == Beginning::odometry
                               ? "resumed where an odometry says that the robot is; the first "
                                 "sweep does not fit the saved state"
                           : is_lost ? "a fresh start: the first sweep does not fit the saved state"
                                     : "begins at the origin";
  if (is_lost)
    log_.warn(text);
  else if (has_past_)
    log_.info(text);
  const Eigen::Vector3d& p = estimate.T_odom_base.translation;
  announcement_ = {is_lost ? Diagnostic::Level::warning : Diagnostic::Level::ok,
                   "locusd: beginning",
                   text,
                   {{"from", std::string{to_string(from)}},
                    {"frame", config_.dds.frame_odom},
                    {"t_ns", fmt::format("{}", to_ns(estimate.stamp))},
                    {"x_m", fmt::format("{}", p.x())},
                    {"y_m", fmt::format("{}", p.y())},
                    {"z_m", fmt::format("{}", p.z())},
                    {"yaw_deg", fmt::format("{}", to_rpy_rad(estimate.T_odom_base.rotation).z() / kRadPerDeg)}}};
}

void Session::tell(TrackingState state) {
  if (told_state_ == state)
    return;
  told_state_ = state;
  const std::string name{to_string(state)};
  if (state == TrackingState::dead_reckoning)
    log_.warn("dead reckoning: no sweep can be registered; look whether the lidars send (locusctl status)",
              {{"LOCUS_STATE", name}});
  else if (state == TrackingState::degenerate)
    log_.warn("degenerate: the surroundings do not constrain every axis; motion sources determine the rest",
              {{"LOCUS_STATE", name}});
  else
    log_.info(name, {{"LOCUS_STATE", name}});
}

namespace {

/// Who is right when a source and lidar contradict each other is not known.
std::string why_lost(const HealthEvent& event) {
  if (!event.verdict.empty())
    return std::string(event.verdict);
  if (event.reason == HealthReason::disagreement)
    return "and lidar disagree on how the robot moves; it is not used until they agree (possible causes: its slip, "
           "scale or stamps, an IMU whose stamps are late, or lidar that follows what moves around the robot)";
  if (event.reason == HealthReason::speed)
    return std::string(kTooFast);
  return fmt::format("is lost ({})", to_string(event.reason));
}

} // namespace

void Session::tell(const HealthEvent& event) {
  const std::string& name = config_.motion_sources[index_of(event.source)].name;
  if (event.healthy)
    log_.info(fmt::format("motion source {} is back", name), {{"LOCUS_SOURCE", name}});
  else
    log_.warn(fmt::format("motion source {} {}; the next best one is used", name, why_lost(event)),
              {{"LOCUS_SOURCE", name}, {"LOCUS_REASON", std::string{to_string(event.reason)}}});
}

Figures Session::figures() const {
  Figures figures{.config = config_, .spent = MachineTime::now() - started_};
  figures.duration = figures.spent.wall;
  figures.counters = pipeline_->counters();
  Figures::Live& live = *(figures.live = Figures::Live{});
  live.flat_ground = flat_ground();
  live.kernel_drops = input_.kernel_drops();
  live.filtered = input_.filtered();
  live.motion_drops = input_.motion_drops();
  live.unfetched = pipeline_->unfetched();
  live.link = link_.status();
  if (recorder_) {
    live.recording = recorder_->status();
    figures.capture = live.recording->run.string();
  }
  const std::scoped_lock lock(told_mutex_);
  figures.ingest = told_.ingest;
  figures.sweeps = told_.sweeps.figures();
  live.unpublished = told_.unpublished;
  if (figures.sweeps.last)
    figures.sweeps.last = on_the_wall(*figures.sweeps.last);
  const auto put_on_the_wall = [this](auto& sensors) {
    for (auto& sensor : sensors)
      sensor.last_heard = sensor.last_heard == Stamp{} ? Stamp{} : input_.time().wall(sensor.last_heard);
  };
  put_on_the_wall(figures.ingest.lidars);
  put_on_the_wall(figures.ingest.sources);
  return figures;
}

Session::Progress Session::progress() const {
  return {pipeline_->progress(), publisher_progress_.load(std::memory_order_relaxed), link_.progress()};
}

} // namespace locus::daemon
