// SPDX-License-Identifier: Apache-2.0
#include "core/ingest/sweep_builder.hpp"

#include <algorithm>
#include <utility>

namespace locus {

namespace {

constexpr int kFullTurn_cdeg = 36000;
constexpr Duration kMinPeriod = std::chrono::milliseconds{40}; ///< 1500 rpm
constexpr Duration kMaxPeriod = std::chrono::milliseconds{250};
constexpr Duration kDefaultPeriod = std::chrono::milliseconds{100};

/// Longest gap that counts as a run of empty windows; a longer one is a clock step or a restart.
constexpr Duration kMaxPause = std::chrono::seconds{60};

/// Number of consecutive late packets, and their time span, that cause a restart: packets delayed by a network are
/// late, too, but arrive all at once.
constexpr std::uint64_t kLatePacketsToRestart = 500;
constexpr Duration kLateToRestart = std::chrono::milliseconds{500};

/// Longest lateness that is waited for instead, since a sender that waited for a processor catches up slowly. Stamps of
/// sweeps go back only by more.
constexpr Duration kLatestThatIsWaitedFor = std::chrono::seconds{2};

} // namespace

void RevolutionTimer::observe(const LidarPacket& packet) {
  constexpr double kMaxStep_s = 0.02;
  constexpr double kForget = 0.995; ///< memory of a few sweeps
  if (lidar_ && packet.lidar > *lidar_)
    return;
  const bool follows = lidar_ == packet.lidar;
  const double step_s = to_seconds(packet.stamp - last_stamp_);
  const int step_cdeg = (packet.first_azimuth_cdeg + kFullTurn_cdeg - last_azimuth_cdeg_) % kFullTurn_cdeg;
  lidar_ = packet.lidar;
  last_stamp_ = packet.stamp;
  last_azimuth_cdeg_ = packet.first_azimuth_cdeg;
  if (!follows || step_s <= 0.0 || step_s > kMaxStep_s || step_cdeg == 0)
    return;
  azimuth_sum_cdeg_ = kForget * azimuth_sum_cdeg_ + step_cdeg;
  time_sum_s_ = kForget * time_sum_s_ + step_s;
}

Duration RevolutionTimer::period() const {
  if (azimuth_sum_cdeg_ <= 0.0)
    return kDefaultPeriod;
  return std::clamp(from_seconds(kFullTurn_cdeg * time_sum_s_ / azimuth_sum_cdeg_), kMinPeriod, kMaxPeriod);
}

SweepBuilder::SweepBuilder(const SweepOptions& options, std::vector<Pose> T_base_lidar, MotionSources sources,
                           std::size_t max_returns, Sink sink, StageClock* clock)
    : options_(options), T_base_lidar_(std::move(T_base_lidar)),
      may_follow_clouds_(T_base_lidar_.size() == 1 && !options.sweep_period), sources_(std::move(sources)),
      sink_(std::move(sink)), clock_(clock), max_returns_(max_returns),
      segments_(T_base_lidar_.size(), options.segment_filter.points, options.isa),
      normals_(RingSegments::kMaxSegments, options.isa),
      voxel_filter_(options.voxel_filter, options.voxel_filter.enabled ? max_returns : 0),
      random_filter_(options.random_filter, options.seed) {
  const std::size_t points = options.segment_filter.enabled ? RingSegments::kMaxSegments : max_returns;
  sweep_.points.reserve(std::min(points, max_returns));
  if (keeps_singly())
    raw_.reserve(max_returns);
}

Duration SweepBuilder::period() const { return options_.sweep_period.value_or(revolution_.period()); }

void SweepBuilder::add(const LidarPacket& packet, Stamp arrival) {
  const StageScope scope(clock_, Stage::correct);
  revolution_.observe(packet);
  const bool follows = packet.cloud && may_follow_clouds_;
  lag_ = std::max(Duration::zero(), arrival - (packet.cloud ? packet.cloud->begin : packet.stamp));
  const bool late = window_ && packet.stamp < window_->start - kMaxLateness;
  if (late) {
    ++counters_.late_packets;
    late_since_ = consecutive_late_ == 0 ? arrival : std::min(late_since_, arrival);
    if (++consecutive_late_ < kLatePacketsToRestart || arrival - late_since_ < kLateToRestart ||
        window_->start - packet.stamp < kLatestThatIsWaitedFor)
      return;
  }
  consecutive_late_ = 0;
  if (late || (window_ && packet.stamp > window_->end + kMaxPause)) {
    close();
    window_.reset();
    ++counters_.restarts;
  }
  if (!window_)
    open(packet.cloud ? std::min(packet.stamp, packet.cloud->begin) : packet.stamp);
  else if (sweep_.sequence == 0 && !follows)
    window_->end = window_->start + period(); // the revolution time is still being learned

  // A cloud of a single instant has its firings at its end and may arrive a little late: its begin ends the window.
  const Stamp first = follows ? std::min(packet.stamp, packet.cloud->begin) : packet.stamp;
  while (first >= window_->end)
    close();
  if (follows)
    end_with(*packet.cloud);
  const Stamp after = packet.stamp + packet.duration;
  append(packet, packet.stamp, std::min(after, window_->end));
  if (after > window_->end) {
    const Stamp cut = window_->end;
    close();
    append(packet, cut, after);
  } else if (follows && packet.cloud->ends_here && after == window_->end) {
    close();
  }
}

/// Ends the window at the end of the current cloud. If a cloud is missing, its window ends where the current cloud
/// begins.
void SweepBuilder::end_with(const LidarPacket::Cloud& cloud) {
  constexpr double kAlmost = 0.9;
  if (to_seconds(cloud.begin - window_->start) > kAlmost * to_seconds(period())) {
    window_->end = std::min(window_->end, cloud.begin);
    close();
  }
  // Clouds that are too short for one sweep each are merged.
  if (cloud.end > window_->start)
    window_->end =
        cloud.end - window_->start < kMinPeriod ? std::max(window_->end, cloud.end + Duration{1}) : cloud.end;
}

void SweepBuilder::advance(Stamp now) {
  sources_.advance(now);
  if (!window_ || now - lag_ > window_->end + kMaxPause)
    return;
  while (now - lag_ > window_->end + kGrace)
    close();
}

void SweepBuilder::finish() {
  if (window_ && 2 * (window_->last_firing - window_->start) > window_->end - window_->start) {
    window_->end = window_->last_firing;
    close();
  }
  window_.reset();
}

void SweepBuilder::open(Stamp start) {
  window_.emplace(start, start + period());
  if (options_.motion_correction)
    window_->choice = sources_.choose(start);
  window_->uncorrected = options_.motion_correction ? window_->choice.uncorrected() : Uncorrected::nothing;
  sweep_.raw_returns = 0;
  sweep_.path.count = 0;
}

Pose SweepBuilder::T_start_base(Stamp stamp) {
  std::optional<Pose> T_start_base = follow_sources(stamp);
  if (!T_start_base) {
    hand_over(stamp);
    T_start_base = follow_sources(stamp);
  }
  if (!T_start_base) // the packet is older than a track
    return window_->T_start_placed;
  if (stamp > window_->placed) {
    window_->placed = stamp;
    window_->T_start_placed = *T_start_base;
  }
  return *T_start_base;
}

/// Returns the base pose according to the sources of the window; nothing if one of them has gone silent. Motion that a
/// source measured when the window began, and none measures now, continues with the last twist.
std::optional<Pose> SweepBuilder::follow_sources(Stamp stamp) const {
  const SourceChoice& choice = window_->choice;
  std::optional<Pose> T_anchor_base = sources_.motion(choice, window_->anchor, stamp);
  if (!T_anchor_base)
    return std::nullopt;
  if (choice.uncorrected() != window_->uncorrected) {
    const Pose T_coasting = se3_exp(to_seconds(stamp - window_->anchor) * last_twist_base_);
    if (!choice.translation)
      T_anchor_base->translation = T_coasting.translation;
    if (!choice.rotation)
      T_anchor_base->rotation = T_coasting.rotation;
  }
  return window_->T_start_anchor * *T_anchor_base;
}

/// Switches to the next best sources when one has gone silent in mid-sweep, from the last known pose on.
void SweepBuilder::hand_over(Stamp now) {
  window_->anchor = window_->placed;
  window_->T_start_anchor = window_->T_start_placed;
  window_->choice = sources_.choose(now);
}

/// Returns the motion within a packet, approximated as linear: a transform and its rate.
PacketMotion SweepBuilder::motion_of(const LidarPacket& packet) {
  const Pose& T_base_lidar = T_base_lidar_[packet.lidar];
  const Pose T_start_begin = T_start_base(packet.stamp);
  note_place(packet.stamp, T_start_begin);
  const Pose begin = T_start_begin * T_base_lidar;
  const Pose end = T_start_base(packet.stamp + packet.duration) * T_base_lidar;
  const double per_s = 1.0 / std::max(1e-9, to_seconds(packet.duration));
  const Eigen::Matrix3d R = begin.R();
  return {R.cast<float>(), begin.translation.cast<float>(), (per_s * (end.R() - R)).cast<float>(),
          (per_s * (end.translation - begin.translation)).cast<float>(),
          static_cast<float>(to_seconds(packet.stamp - window_->start))};
}

/// Records the path of the base in even steps.
void SweepBuilder::note_place(Stamp stamp, const Pose& T_start_base) {
  CorrectedPath& path = sweep_.path;
  constexpr std::size_t kSteps = CorrectedPath::kMaxPlaces - 1; // the last place is for the end
  const bool soon = path.count > 0 &&
                    stamp < path.places[path.count - 1].stamp + (window_->end - window_->start) / Duration::rep{kSteps};
  if (options_.motion_correction && !soon && path.count < kSteps)
    path.places[path.count++] = {stamp, T_start_base};
}

void SweepBuilder::move_to_end() {
  const Pose T_start_end = T_start_base(window_->end);
  last_twist_base_ = se3_log(T_start_end) / to_seconds(window_->end - window_->start);
  if (options_.motion_correction)
    sweep_.path.places[sweep_.path.count++] = {window_->end, T_start_end};
  if (T_start_end == Pose{})
    return;
  const Pose T_end_start = T_start_end.inverse();
  const Eigen::Matrix3f R = T_end_start.R().cast<float>();
  const Eigen::Vector3f t = T_end_start.translation.cast<float>();
  for (std::vector<SweepPoint>* const points : {&sweep_.points, &sweep_.returns}) {
    for (SweepPoint& point : *points) {
      point.position_base_m = R * point.position_base_m + t;
      point.normal_base = R * point.normal_base;
    }
  }
}

void SweepBuilder::close() {
  const StageScope scope(clock_, Stage::filter);
  sweep_.start = window_->start;
  sweep_.end = window_->end;
  sweep_.uncorrected = window_->uncorrected;
  sweep_.lidars.count = std::min(T_base_lidar_.size(), kMaxLidars);
  for (std::size_t i = 0; i < sweep_.lidars.count; ++i)
    sweep_.lidars.base_m[i] = T_base_lidar_[i].translation.cast<float>();
  reduce(static_cast<float>(to_seconds(sweep_.end - sweep_.start)));
  move_to_end();
  sweep_.motion = sources_.sensed_in(sweep_.start, sweep_.end);
  sink_(sweep_);
  ++sweep_.sequence;
  open(window_->end);
}

} // namespace locus
