// SPDX-License-Identifier: Apache-2.0
#include "core/sweep_builder.hpp"

#include <algorithm>
#include <utility>

namespace locus {

namespace {

constexpr int kFullTurn_cdeg = 36000;
constexpr Duration kMinPeriod = std::chrono::milliseconds{40}; ///< 1500 rpm
constexpr Duration kMaxPeriod = std::chrono::milliseconds{250};
constexpr Duration kDefaultPeriod = std::chrono::milliseconds{100};

/// A gap longer than this is a jump of the clock or a new start, not a run of empty windows.
constexpr Duration kMaxGap = std::chrono::seconds{60};
constexpr std::uint64_t kLatePacketsToRestart = 500;

constexpr std::size_t kReturnsPerSegmentPoint = 4; ///< room for what the leaf has not learned yet

struct Affine {
  Eigen::Matrix3f R;
  Eigen::Vector3f t;
  Eigen::Vector3f operator*(const Eigen::Vector3f& p) const { return R * p + t; }
};

Affine affine(const Pose& T) { return {T.R().cast<float>(), T.translation.cast<float>()}; }

} // namespace

void RevolutionTimer::observe(const LidarPacket& packet) {
  constexpr double kMaxStep_s = 0.02;
  constexpr double kForget = 0.995; ///< a memory of a few sweeps
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
    : options_(options), T_base_lidar_(std::move(T_base_lidar)), sources_(std::move(sources)), sink_(std::move(sink)),
      clock_(clock), max_returns_(max_returns), segments_(T_base_lidar_.size(), options.segment_filter.points),
      normals_(RingSegments::kMaxSegments),
      voxel_filter_(options.voxel_filter, options.voxel_filter.enabled ? max_returns : 0),
      random_filter_(options.random_filter, options.seed) {
  const std::size_t points =
      options.segment_filter.enabled ? kReturnsPerSegmentPoint * options.segment_filter.points : max_returns;
  sweep_.points.reserve(std::min(points, max_returns));
  if (!options.segment_filter.enabled)
    raw_.reserve(max_returns);
}

Duration SweepBuilder::period() const { return options_.sweep_period.value_or(revolution_.period()); }

void SweepBuilder::add(const LidarPacket& packet, Stamp arrival) {
  const StageScope scope(clock_, Stage::correct);
  revolution_.observe(packet);
  lag_ = std::max(Duration::zero(), arrival - packet.stamp);
  if (window_ && packet.stamp < window_->start - kMaxLateness) {
    ++counters_.late_packets;
    if (++consecutive_late_ < kLatePacketsToRestart)
      return;
  }
  const bool jumped = window_ && (consecutive_late_ >= kLatePacketsToRestart || packet.stamp > window_->end + kMaxGap);
  consecutive_late_ = 0;
  if (jumped) {
    close();
    window_.reset();
    ++counters_.restarts;
  }
  if (!window_)
    open(packet.stamp);
  else if (sweep_.sequence == 0)
    window_->end = window_->start + period(); // the first window still learns how long a revolution is

  while (packet.stamp >= window_->end)
    close();
  const Stamp after = packet.stamp + packet.duration;
  append(packet, packet.stamp, std::min(after, window_->end));
  if (after > window_->end) {
    const Stamp cut = window_->end;
    close();
    append(packet, cut, after);
  }
}

void SweepBuilder::advance(Stamp now) {
  if (!window_ || now - lag_ > window_->end + kMaxGap)
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
  window_ = Window{start, start + period(), {}, start, Pose{}};
  if (options_.motion_correction)
    window_->choice = sources_.choose(start);
  sweep_.raw_returns = 0;
}

Pose SweepBuilder::T_start_base(Stamp stamp) {
  if (const std::optional<Pose> T = sources_.motion(window_->choice, window_->start, stamp))
    window_->T_start_base = *T;
  return window_->T_start_base;
}

bool SweepBuilder::in_range(float range_m) const {
  return static_cast<double>(range_m) >= options_.min_range_m && static_cast<double>(range_m) <= options_.max_range_m;
}

bool SweepBuilder::inside_body(const Eigen::Vector3f& p_base) const {
  const BodyBoxOptions& box = options_.body_box;
  return (p_base.array() > box.min_m.cast<float>().array()).all() &&
         (p_base.array() < box.max_m.cast<float>().array()).all();
}

/// Takes in the returns fired in [from, to). Within the packet the motion is taken as linear: a transform and its rate.
void SweepBuilder::append(const LidarPacket& packet, Stamp from, Stamp to) {
  const Pose& T_base_lidar = T_base_lidar_[packet.lidar];
  const Affine begin = affine(T_start_base(packet.stamp) * T_base_lidar);
  const Affine end = affine(T_start_base(packet.stamp + packet.duration) * T_base_lidar);
  const float per_ns = 1.0F / std::max(1.0F, static_cast<float>(packet.duration.count()));
  const Affine rate{per_ns * (end.R - begin.R), per_ns * (end.t - begin.t)};
  const Affine mount = affine(T_base_lidar);
  const auto first_ns = static_cast<std::int32_t>((from - packet.stamp).count());
  const auto last_ns = static_cast<std::int32_t>((to - packet.stamp).count());
  const auto packet_s = static_cast<float>(to_seconds(packet.stamp - window_->start));
  const bool is_first_part = from == packet.stamp; // takes what fires ahead of the stamp, too

  for (const LidarReturn& r : packet.returns()) {
    if (r.offset_ns >= last_ns || (r.offset_ns < first_ns && !is_first_part))
      continue;
    ++sweep_.raw_returns;
    const Eigen::Vector3f p_lidar{r.x_m, r.y_m, r.z_m};
    if (!in_range(r.range_m) || (options_.body_box.enabled && inside_body(mount * p_lidar)))
      continue;
    const auto offset_ns = static_cast<float>(r.offset_ns);
    const Eigen::Vector3f p_start = begin * p_lidar + offset_ns * (rate * p_lidar);
    keep({p_start, Eigen::Vector3f::Zero(), packet_s + 1e-9F * offset_ns, static_cast<float>(r.intensity),
          static_cast<std::uint16_t>(packet.lidar * 256U + r.ring)},
         r.range_m);
  }
  window_->last_firing = std::max(window_->last_firing, to);
}

/// `point.age_s` still counts from the start of the window.
void SweepBuilder::keep(const SweepPoint& point, float range_m) {
  const std::uint32_t segment =
      segments_.add(point.scan_line, point.position_base_m, range_m, point.age_s, point.intensity);
  const bool singly = !options_.segment_filter.enabled;
  if (segment == RingSegments::kNone || (singly && raw_.size() == max_returns_))
    ++counters_.overflowed_points;
  else if (singly)
    raw_.push_back({point, segment});
}

/// The filters over the sweep, and the normals, which are found on the segments whatever becomes of these.
void SweepBuilder::reduce(float duration_s) {
  segments_.finish(duration_s, sweep_.points);
  {
    const StageScope scope(clock_, Stage::covariance);
    normals_.estimate(sweep_.points);
  }
  if (!options_.segment_filter.enabled) {
    for (RawPoint& raw : raw_) {
      if (const std::uint32_t place = segments_.place_of(raw.segment); place != RingSegments::kNone)
        raw.point.normal_base = sweep_.points[place].normal_base;
      raw.point.age_s = duration_s - raw.point.age_s;
    }
    sweep_.points.clear();
    for (const RawPoint& raw : raw_)
      sweep_.points.push_back(raw.point);
    raw_.clear();
  }
  if (options_.voxel_filter.enabled)
    voxel_filter_.apply(sweep_.points);
  if (options_.random_filter.enabled)
    random_filter_.apply(sweep_.points);
  sweep_.registered = sweep_.points.size();
  if (options_.segment_filter.enabled && sweep_.points.size() > options_.segment_filter.points)
    choose_registered();
}

/// Moves as many points to the front as are wanted, evenly chosen along the scan lines.
void SweepBuilder::choose_registered() {
  const std::size_t wanted = options_.segment_filter.points;
  const std::size_t total = sweep_.points.size();
  unregistered_.clear();
  sweep_.registered = 0;
  for (std::size_t i = 0; i < total; ++i) {
    if ((i + 1) * wanted / total != i * wanted / total)
      sweep_.points[sweep_.registered++] = sweep_.points[i];
    else
      unregistered_.push_back(sweep_.points[i]);
  }
  std::copy(unregistered_.begin(), unregistered_.end(), sweep_.points.begin() + static_cast<std::ptrdiff_t>(wanted));
}

void SweepBuilder::move_to_end() {
  const Pose T_end_start = T_start_base(window_->end).inverse();
  const Eigen::Matrix3f R = T_end_start.R().cast<float>();
  const Eigen::Vector3f t = T_end_start.translation.cast<float>();
  for (SweepPoint& point : sweep_.points) {
    point.position_base_m = R * point.position_base_m + t;
    point.normal_base = R * point.normal_base;
  }
}

void SweepBuilder::close() {
  const StageScope scope(clock_, Stage::filter);
  sweep_.start = window_->start;
  sweep_.end = window_->end;
  sweep_.uncorrected = options_.motion_correction ? window_->choice.uncorrected() : Uncorrected::nothing;
  reduce(static_cast<float>(to_seconds(sweep_.end - sweep_.start)));
  if (window_->choice.rotation)
    move_to_end();
  sources_.describe(sweep_);
  sink_(sweep_);
  ++sweep_.sequence;
  open(window_->end);
}

} // namespace locus
