// SPDX-License-Identifier: Apache-2.0
#include "daemon/service/session.hpp"

#include <algorithm>
#include <string_view>
#include <utility>
#include <variant>

#include <fmt/format.h>
#include <pthread.h>

#include "daemon/machine_time.hpp"
#include "daemon/service/control.hpp"
#include "daemon/service/machine.hpp"

namespace locus::daemon {

namespace {

constexpr Duration kDiskRound = std::chrono::milliseconds{100}; ///< period of the disk thread

std::vector<bool> publishes_clouds(const std::vector<LidarOptions>& lidars) {
  std::vector<bool> publishes(lidars.size());
  std::transform(lidars.begin(), lidars.end(), publishes.begin(),
                 [](const auto& lidar) { return lidar.gives_clouds(); });
  return publishes;
}

} // namespace

Expected<std::unique_ptr<Session>, std::string> Session::start(const Config& config, std::span<const int> inherited,
                                                               std::optional<SavedState> state, Incidents* incidents,
                                                               std::atomic<std::uint64_t>& resets, Log& log) {
  auto lidars = LidarRouter::open(config.lidars);
  if (!lidars)
    return lidars.error();
  auto sockets = open_lidar_sockets(config, inherited, log);
  if (!sockets)
    return sockets.error();
  return std::unique_ptr<Session>(
      new Session(config, std::move(*lidars), std::move(*sockets), std::move(state), incidents, resets, log));
}

Session::Session(const Config& config, LidarRouter lidars, std::vector<UdpSocket> sockets,
                 std::optional<SavedState> state, Incidents* incidents, std::atomic<std::uint64_t>& resets, Log& log)
    : config_(config), log_(log), started_(MachineTime::now()),
      input_(std::move(sockets), publishes_clouds(config.lidars)),
      flat_ground_(state && state->is_recent ? state->flat_ground : config.odometry.flat_ground), incidents_(incidents),
      resets_(resets), link_(
                           config, [this](const RosInput& input) { receive(input); }, instance_name(),
                           [this](std::uint8_t lidar, Stamp arrival, std::string_view type,
                                  const SerialisedSample& cloud) { receive(lidar, arrival, type, cloud); }),
      clouds_(config.dds, link_), start_(std::move(state)),
      state_saver_(state_path(), config.motion_sources, [this](const std::string& problem) { log_.error(problem); }) {
  if (start_) {
    start_->reset_changed_sources(ids_of(config_.motion_sources));
    const Duration age = Stamp{read_clock(CLOCK_REALTIME)} - start_->last.stamp;
    calibration_ = {start_->last.learned, std::max(0.0, to_seconds(age))};
  }
  // NOLINTNEXTLINE(cppcoreguidelines-prefer-member-initializer): grouped with the use of start_
  has_saved_map_ = start_ && start_->is_recent && !start_->map_odom.empty();
  begin(std::move(lidars));
}

Session::~Session() { end(); }

void Session::begin(LidarRouter lidars) {
  LiveOptions options;
  if (start_ && start_->is_recent)
    options.start = {start_->last, start_->map_odom};
  options.calibration = calibration_;
  options.on_thread_start = [this] {
    if (const auto problem = raise_priority(config_.realtime.priority))
      log_.warn(*problem);
    if (!scheduling_logged_.exchange(true))
      log_.info("running with " + scheduling());
  };
  options.after_estimate = [this](const Sweep& sweep, const Odometry& odometry, const OdometryEstimate& estimate) {
    after_estimate(sweep, odometry, estimate);
  };
  run_began_ = Stamp{read_clock(CLOCK_REALTIME)};
  InputSource& input = begin_recording();
  disk_.emplace(
      "disk", kDiskRound, [this](bool last) { write_to_disk(last); }, [] { set_lowest_priority(); });
  const std::scoped_lock lock(pipeline_mutex_);
  pipeline_ = std::make_unique<LivePipeline>(config_, std::move(lidars), input, std::move(options));
  pipeline_->set_flat_ground(flat_ground());
  stopping_.store(false, std::memory_order_relaxed);
  publisher_ = std::thread([this] { run_publisher(); });
  pthread_setname_np(publisher_.native_handle(), "publisher");
}

void Session::end() {
  stopping_.store(true, std::memory_order_relaxed);
  if (publisher_.joinable())
    publisher_.join();
  pipeline_->stop();
  while (const auto done = pipeline_->next(Duration::zero()))
    publish(*done);
  disk_.reset();
}

/// Converts the times of an estimate from SteadyTime to the host's wall clock.
OdometryEstimate Session::in_wall_time(const OdometryEstimate& estimate) const {
  OdometryEstimate converted = estimate;
  converted.stamp = input_.time().to_wall(estimate.stamp);
  for (SourceReport& source : converted.sources) {
    if (source.last_used != Stamp{})
      source.last_used = input_.time().to_wall(source.last_used);
    if (source.learned)
      source.learned->since = input_.time().to_wall(source.learned->since);
  }
  return converted;
}

/// Odometry thread: hands over clouds, state and map after the estimate was handed over.
void Session::after_estimate(const Sweep& sweep, const Odometry& odometry, const OdometryEstimate& steady_estimate) {
  const OdometryEstimate estimate = in_wall_time(steady_estimate);
  if (estimate.beginning)
    start_.reset();
  clouds_.submit(sweep, odometry, estimate);
  hand_to_viewer(sweep, odometry, estimate);
  state_saver_.update(odometry, estimate, flat_ground());
  const std::uint64_t wanted = map_requests_.load(std::memory_order_relaxed);
  if (wanted == map_delivered_)
    return;
  map_delivered_ = wanted;
  map_.back().request = wanted;
  read_planes(odometry.map().fine(), map_.back().points);
  static_cast<void>(map_.publish());
}

/// Copies the points only while a viewer asks for them.
void Session::hand_to_viewer(const Sweep& sweep, const Odometry& odometry, const OdometryEstimate& estimate) {
  if (read_clock(CLOCK_MONOTONIC) > viewed_until_.load(std::memory_order_relaxed))
    return;
  ViewedSweep& next = viewed_.back();
  next.run_began = run_began_;
  next.sequence = sweep.sequence;
  next.stamp = estimate.stamp;
  next.T_odom_base = estimate.T_odom_base;
  next.points.assign(odometry.scan().begin(), odometry.scan().end());
  static_cast<void>(viewed_.publish());
}

const Session::ViewedSweep* Session::view() {
  constexpr Duration kInterest = std::chrono::seconds{1};
  viewed_until_.store(read_clock(CLOCK_MONOTONIC) + kInterest, std::memory_order_relaxed);
  if (const ViewedSweep* const next = viewed_.poll())
    last_viewed_ = next;
  return last_viewed_;
}

const std::vector<SurfacePoint>* Session::poll_map() {
  const Map* const map = map_.poll();
  return map != nullptr && map->request == map_requests_.load(std::memory_order_relaxed) ? &map->points : nullptr;
}

std::optional<std::string> Session::reset(std::optional<Pose> T_odom_base) {
  auto lidars = LidarRouter::open(config_.lidars);
  if (!lidars)
    return lidars.error();
  end();
  log_.info("run ended: " + summary_line(figures()));
  start_.reset();
  if (state_saver_.last())
    calibration_ = {state_saver_.last()->learned, 0.0};
  if (T_odom_base)
    start_ = {{Stamp{read_clock(CLOCK_REALTIME)}, *T_odom_base}, flat_ground(), {}};
  state_saver_.reset(start_);
  has_saved_map_ = announced_ = false;
  announcement_.reset();
  collected_ = {};
  begin(std::move(*lidars));
  log_.info("odometry reset on request");
  return std::nullopt;
}

std::optional<SavedState> Session::stop() {
  end();
  if (!state_saver_.last()) {
    if (start_)
      start_->flat_ground = flat_ground();
    return std::move(start_);
  }
  SavedState state{*state_saver_.last(), flat_ground(), {}, ids_of(config_.motion_sources)};
  read_map(pipeline_->processor().odometry(), state.last.T_odom_base, state.map_odom);
  return state;
}

void Session::receive(const RosInput& input) {
  if (const auto* message = std::get_if<FlatGroundMessage>(&input))
    apply(*message);
  else if (const auto* imu = std::get_if<ImuInput>(&input))
    input_.push(*imu);
  else if (const auto* odometry = std::get_if<OdometryInput>(&input))
    input_.push(*odometry);
  else
    input_.push(std::get<ExternalHealth>(input));
}

/// Copies a cloud into the input. Allocates only for a cloud larger than all earlier ones.
void Session::receive(std::uint8_t lidar, Stamp arrival, std::string_view type, const SerialisedSample& cloud) {
  CloudBytes& next = input_.next_cloud(lidar);
  next.arrival = arrival;
  next.type = type;
  next.too_large = cloud.size() > CloudBytes::kMaxBytes;
  next.bytes.resize(next.too_large ? 0 : cloud.size());
  if (!next.too_large)
    cloud.copy_to(next.bytes);
  input_.push_cloud(lidar);
}

/// Applies a flat-ground message, at most one change a second, to suppress chatter of the topic.
void Session::apply(FlatGroundMessage message) {
  constexpr Duration kMinInterval = std::chrono::seconds{1};
  const FlatGround wanted = message.flat ? FlatGround::on : FlatGround::off;
  const Duration now = read_clock(CLOCK_MONOTONIC);
  if (wanted == flat_ground() || now - flat_ground_changed_ < kMinInterval)
    return;
  flat_ground_changed_ = now;
  set_flat_ground(wanted);
  log_.info(fmt::format("flat ground turned {} by a message on {}", message.flat ? "on" : "off",
                        config_.dds.flat_ground_topic));
}

void Session::set_flat_ground(FlatGround mode) {
  flat_ground_.store(mode, std::memory_order_relaxed);
  const std::scoped_lock lock(pipeline_mutex_);
  if (pipeline_)
    pipeline_->set_flat_ground(mode);
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
  for (std::size_t i = 0; i < config_.lidars.size(); ++i)
    live.cloud_drops[i] = input_.cloud_drops(i);
  live.unfetched = pipeline_->unfetched();
  live.resets = resets_.load(std::memory_order_relaxed);
  live.link = link_.status();
  if (stores_incidents())
    live.incidents = incidents_->status();
  if (recorder_ && !config_.record.folder.empty()) {
    live.recording = recorder_->status();
    figures.capture = live.recording->run.string();
  } else if (recorder_) {
    const Recorder::Status ring = recorder_->status();
    live.incidents->dropped = ring.dropped;
    if (live.incidents->problem.empty())
      live.incidents->problem = ring.problem;
  }
  const std::scoped_lock lock(collected_mutex_);
  figures.ingest = collected_.ingest;
  figures.sweeps = collected_.sweeps.figures();
  live.unpublished = collected_.unpublished;
  if (figures.sweeps.last)
    figures.sweeps.last = in_wall_time(*figures.sweeps.last);
  const auto wall = [this](Stamp steady) { return steady == Stamp{} ? Stamp{} : input_.time().to_wall(steady); };
  const auto convert_last_received = [&](auto& sensors) {
    for (auto& sensor : sensors)
      sensor.last_received = wall(sensor.last_received);
  };
  convert_last_received(figures.ingest.lidars);
  for (IngestReport::Lidar& lidar : figures.ingest.lidars) {
    convert_last_received(lidar.other_senders);
    lidar.unknown_last_received = wall(lidar.unknown_last_received);
  }
  convert_last_received(figures.ingest.sources);
  return figures;
}

Session::Progress Session::progress() const {
  return {pipeline_->progress(), publisher_progress_.load(std::memory_order_relaxed), link_.progress()};
}

} // namespace locus::daemon
