// SPDX-License-Identifier: Apache-2.0
#include "drivers/clouds/cloud_decoder.hpp"

#include <algorithm>
#include <bitset>
#include <cmath>
#include <cstring>
#include <functional>
#include <numbers>
#include <numeric>
#include <string_view>
#include <utility>

namespace locus {

namespace {

constexpr Duration kLongestSlice = std::chrono::microseconds{1330}; ///< duration of a VLP-16 packet
/// Span of the firings of a cloud of one instant. They need an order, from which the neighbours of a point on other
/// rings are found; a robot moves by less than the lidar's noise in this time.
constexpr Duration kInstant = std::chrono::microseconds{50};
/// Resolution of the sort by time: a sixteenth of the mean interval between points, or 1/65536 of the cloud if that is
/// longer.
constexpr std::size_t kBucketsPerPoint = 16;
constexpr std::size_t kMaxBuckets = std::size_t{1} << 16;
constexpr double kTurn_rad = 2 * std::numbers::pi;
constexpr double kCdegPerTurn = 36000;

/// Least number of points from which the time unit can be estimated.
constexpr std::size_t kFewPoints = 100;

double azimuth_rad(float x_m, float y_m) { return std::atan2(static_cast<double>(y_m), static_cast<double>(x_m)); }

/// Hashes (FNV-1a) the number of points and evenly spaced samples of their bytes. Precondition: the layout is valid.
std::uint64_t digest_of(const CloudView& message) {
  constexpr std::uint64_t kFnvBasis = 0xcbf29ce484222325, kFnvPrime = 0x100000001b3;
  constexpr std::size_t kWords = 256;
  std::uint64_t digest = (kFnvBasis ^ points_of(message)) * kFnvPrime;
  const std::size_t last = message.data.size() - std::min(message.data.size(), sizeof(digest));
  for (std::size_t k = 0; k < kWords && last > 0; ++k) {
    std::uint64_t word = 0;
    std::memcpy(&word, &message.data[last * k / (kWords - 1)], sizeof(word));
    digest = (digest ^ word) * kFnvPrime;
  }
  return digest;
}

template <class Figure> void keep_only(std::vector<Figure>& figures, const std::vector<std::uint32_t>& places) {
  for (std::size_t i = 0; i < places.size(); ++i)
    figures[i] = figures[places[i]];
  figures.resize(places.size());
}

} // namespace

CloudDecoder::CloudDecoder(std::uint8_t lidar, PointTimesFrom times) : times_from_(times) {
  packet_.lidar = lidar;
  for (auto* figures : {&points_.x_m, &points_.y_m, &points_.z_m, &points_.intensity, &points_.ring})
    figures->reserve(kMaxCloudPoints);
  points_.time.reserve(kMaxCloudPoints);
  points_.laser.reserve(kMaxCloudPoints);
  points_.offset_ns.reserve(kMaxCloudPoints);
  points_.order.reserve(kMaxCloudPoints);
  buckets_.reserve(kMaxBuckets + 1);
}

CloudError CloudDecoder::refuse(CloudError error) {
  ++counters_.received;
  ++counters_[error];
  return error;
}

std::optional<CloudError> CloudDecoder::begin(const CloudView& message, Stamp arrival) {
  points_.order.clear();
  next_ = 1;
  const Expected<CloudLayout, CloudError> layout = layout_of(message);
  if (!layout)
    return refuse(layout.error());
  const std::size_t frame = std::hash<std::string_view>{}(message.frame);
  if (is_of_another_lidar(frame, arrival)) {
    doubt(CloudDoubt::two_frames, arrival);
    return refuse(CloudError::frame);
  }
  if (message.stamp != Stamp{} && last_stamp_ == message.stamp && last_digest_ == digest_of(message))
    return refuse(CloudError::duplicate);
  if (layout_ != *layout) {
    layout_ = *layout;
    times_.reset();
    unit_votes_ = 0;
    stamped_at_ = {};
  }
  read(message, *layout);
  const Counted counted = keep_returns();
  const Stamp begin = time_points(message, *layout, arrival);
  const Duration length{points_.offset_ns.empty() ? 0 : *std::ranges::max_element(points_.offset_ns)};
  const std::optional<Stamp> on_host = on_host_clock(begin, length + Duration{1}, arrival);
  if (!on_host)
    return refuse(CloudError::clock);
  cloud_ = {*on_host, *on_host + length + Duration{1}, false};
  zero_ = cloud_.begin;
  measure_period(arrival);
  sort_by_time();
  if (timing_ == PointTiming::instant)
    cloud_.begin = cloud_.end - period_;
  next_ = 0;
  count(counted);
  last_stamp_ = message.stamp;
  last_digest_ = digest_of(message);
  frame_ = frame;
  last_received_ = arrival;
  return std::nullopt;
}

bool CloudDecoder::is_of_another_lidar(std::size_t frame, Stamp arrival) const {
  constexpr Duration kSilence = std::chrono::seconds{1};
  return last_received_ != Stamp{} && frame != frame_ && std::chrono::abs(arrival - last_received_) < kSilence;
}

void CloudDecoder::count(const Counted& counted) {
  ++counters_.received;
  ++counters_.used;
  counters_.points += counted.points;
  counters_.nan += counted.nan;
  counters_.origin += counted.origin;
  counters_.untimed += counted.untimed;
}

void CloudDecoder::read(const CloudView& message, const CloudLayout& layout) {
  const auto read_column = [&]<class Figure>(const std::optional<CloudLayout::Column>& column,
                                             std::vector<Figure>& figures) {
    figures.clear();
    if (column)
      for_each_in(message, *column, [&](auto value) { figures.push_back(static_cast<Figure>(value)); });
  };
  read_column(layout.x, points_.x_m);
  read_column(layout.y, points_.y_m);
  read_column(layout.z, points_.z_m);
  read_column(layout.intensity, points_.intensity);
  read_column(layout.ring, points_.ring);
  read_column(layout.time, points_.time);
  if (!layout.row_is_ring)
    return;
  for (std::uint32_t row = 0; row < message.height; ++row)
    points_.ring.insert(points_.ring.end(), message.width, static_cast<float>(row));
}

/// Removes points that are not returns, and counts them.
CloudDecoder::Counted CloudDecoder::keep_returns() {
  Counted counted{.points = points_.x_m.size()};
  const auto is_finite = [](auto... values) { return (std::isfinite(values) && ...); };
  for (std::size_t i = 0; i < points_.x_m.size(); ++i) {
    const float x = points_.x_m[i], y = points_.y_m[i], z = points_.z_m[i];
    if (!is_finite(x * x + y * y + z * z))
      ++counted.nan;
    else if (x == 0.0F && y == 0.0F && z == 0.0F)
      ++counted.origin;
    else if (!points_.time.empty() && !is_finite(points_.time[i]))
      ++counted.untimed;
    else
      points_.order.push_back(static_cast<std::uint32_t>(i));
  }
  for (auto* figures : {&points_.x_m, &points_.y_m, &points_.z_m, &points_.intensity, &points_.ring}) {
    if (!figures->empty())
      keep_only(*figures, points_.order);
  }
  if (!points_.time.empty())
    keep_only(points_.time, points_.order);
  return counted;
}

/// Computes the offset of each return. Returns the stamp of offset 0, in the clock of the message.
Stamp CloudDecoder::time_points(const CloudView& message, const CloudLayout& layout, Stamp arrival) {
  const std::size_t count = points_.x_m.size();
  rings_.assign({points_.x_m, points_.y_m, points_.z_m}, points_.ring,
                layout.row_is_ring ? RingsFrom::rows : RingsFrom::field, points_.laser);
  const Stamp header = message.stamp == Stamp{} ? arrival : message.stamp - message.ahead;
  points_.offset_ns.assign(count, 0);
  timing_ = PointTiming::instant;
  if (times_from_ == PointTimesFrom::automatic && understand_times(layout.time.has_value(), arrival)) {
    timing_ = PointTiming::field;
    for (std::size_t i = 0; i < count; ++i)
      points_.offset_ns[i] = static_cast<std::int32_t>(times_->between(times_->first, points_.time[i]).count());
    if (const auto begin = times_->begin_by_clock(header + message.ahead, arrival + message.ahead))
      return *begin - message.ahead;
    return stamped_at_begin(times_->begin_by_header(header), header, arrival);
  }
  if (times_from_ != PointTimesFrom::none && time_by_azimuth(period_)) {
    timing_ = PointTiming::azimuth;
    return stamped_at_begin(header, header, arrival);
  }
  if (!time_by_azimuth(kInstant))
    time_by_place(message);
  const Duration length{count > 0 ? *std::ranges::max_element(points_.offset_ns) : 0};
  return header - length;
}

/// Interprets the message's point times. Returns true if they are valid.
bool CloudDecoder::understand_times(bool has_times, Stamp arrival) {
  if (!has_times)
    doubt(CloudDoubt::no_times, arrival);
  const bool are_few = points_.time.size() < kFewPoints; // too few to estimate the unit
  if (!has_times || points_.time.empty() || (!times_ && are_few))
    return false;
  if (are_few) {
    const auto [first, last] = std::ranges::minmax(points_.time);
    const PointTimes known = PointTimes::in_unit(times_->unit_s, first, last);
    if (!known.is_short_enough())
      return false;
    times_ = known;
    return true;
  }
  const auto known_unit_s = unit_votes_ > 0 ? std::optional{times_->unit_s} : std::nullopt;
  const Expected<PointTimes, CloudDoubt> understood = understand(points_.time, points_.laser, known_unit_s);
  if (!understood) {
    doubt(understood.error(), arrival);
    return false;
  }
  if (spans_too_little(*understood)) {
    doubt(CloudDoubt::no_unit, arrival);
    times_.reset();
    unit_votes_ = 0;
    return false;
  }
  const bool is_turn = understood->between(understood->first, understood->last) >= kShortestCloud;
  if (!known_unit_s || *known_unit_s != understood->unit_s)
    unit_votes_ = 0;
  if (is_turn)
    ++unit_votes_;
  else if (unit_votes_ > 0)
    --unit_votes_;
  times_ = *understood;
  return true;
}

/// Returns true if the points lie all around although their times span a small part of the period: these are shares of
/// the turn, for example, and no times.
bool CloudDecoder::spans_too_little(const PointTimes& times) const {
  constexpr int kSmallPart = 8;
  constexpr std::size_t kSectors = 36;
  if (kSmallPart * times.between(times.first, times.last) >= period_)
    return false;
  std::bitset<kSectors> sectors;
  for (std::size_t i = 0; i < points_.x_m.size(); ++i) {
    const double share = azimuth_rad(points_.x_m[i], points_.y_m[i]) / kTurn_rad + 0.5;
    sectors.set(std::min(static_cast<std::size_t>(share * kSectors), kSectors - 1));
  }
  return 2 * sectors.count() >= kSectors;
}

/// Distributes the returns over kInstant in the order of the message, in which drivers write them as fired. In an
/// organised cloud the longer dimension is time.
void CloudDecoder::time_by_place(const CloudView& message) {
  const std::size_t width = std::max<std::size_t>(message.width, 1);
  const bool is_wide = message.width >= message.height;
  const auto extent = static_cast<double>(std::max(message.width, message.height));
  for (std::size_t i = 0; i < points_.offset_ns.size(); ++i) {
    const std::size_t place = is_wide ? points_.order[i] % width : points_.order[i] / width;
    points_.offset_ns[i] =
        static_cast<std::int32_t>(static_cast<double>(place) / extent * static_cast<double>(kInstant.count()));
  }
}

/// Computes the time of each return from the rotation along its ring since the first return, `turn` for a whole one;
/// the direction of rotation is that of most steps. Returns false if the points do not rotate.
bool CloudDecoder::time_by_azimuth(Duration turn) {
  constexpr double kStep_rad = 0.1, kBeforeFirst_rad = -0.4;
  constexpr std::size_t kNineTenths = 10;
  const std::size_t count = points_.x_m.size();
  std::array<double, Rings::kMax> last_rad;
  last_rad.fill(std::nan(""));
  std::size_t forward = 0, backward = 0; // number of counter-clockwise and clockwise steps
  for (std::size_t i = 0; i < count; ++i) {
    const double azimuth = azimuth_rad(points_.x_m[i], points_.y_m[i]);
    const double step = std::remainder(azimuth - std::exchange(last_rad[points_.laser[i]], azimuth), kTurn_rad);
    forward += step > 0 && step < kStep_rad ? 1U : 0U;
    backward += step < 0 && step > -kStep_rad ? 1U : 0U;
  }
  const std::size_t most = std::max(forward, backward), steps = forward + backward;
  if (count < kFewPoints || 2 * steps < count || kNineTenths * (steps - most) > steps)
    return false;

  const double sign = forward > backward ? 1 : -1;
  const double first_rad = azimuth_rad(points_.x_m.front(), points_.y_m.front());
  std::array<double, Rings::kMax> turned_rad{};
  last_rad.fill(std::nan(""));
  for (std::size_t i = 0; i < count; ++i) {
    const double azimuth = azimuth_rad(points_.x_m[i], points_.y_m[i]);
    double& last = last_rad[points_.laser[i]];
    double& turned = turned_rad[points_.laser[i]];
    if (std::isnan(last)) {
      turned = std::remainder(sign * (azimuth - first_rad), kTurn_rad);
      turned += turned < kBeforeFirst_rad ? kTurn_rad : 0;
    } else {
      turned += std::remainder(sign * (azimuth - last), kTurn_rad);
    }
    last = azimuth;
    const double share = std::clamp(turned / kTurn_rad, 0.0, 1.0);
    points_.offset_ns[i] = static_cast<std::int32_t>(share * static_cast<double>(turn.count()));
  }
  return true;
}

/// Decides whether the header's stamp is that of the first or of the last point. A cloud cannot arrive before its last
/// point: if the stamp, taken as the first point's, puts the last point after the arrival, although the stamp itself
/// precedes the arrival, it is the last point's. The first cloud decides alone; a change needs kEvidence contrary
/// clouds in a row, and a change back to the first point as many as confirmed the last point.
Stamp CloudDecoder::stamped_at_begin(Stamp begin, Stamp header, Stamp arrival) {
  constexpr int kEvidence = 5;
  const Duration length{*std::ranges::max_element(points_.offset_ns)};
  const Stamp end = begin + length;
  const Duration latency = arrival - header;
  if (end <= header)
    return begin;
  if (latency < SourceClock::kMaxLatency && latency > -SourceClock::kMaxAhead) {
    StampedAt& at = stamped_at_;
    const bool is_end = end > arrival + SourceClock::kMaxAhead;
    if (!at.known)
      at = {.known = true, .end = is_end};
    at.confirming = std::min(at.confirming + (is_end == at.end ? 1 : 0), kEvidence);
    at.contrary = is_end == at.end ? 0 : at.contrary + 1;
    if (at.contrary >= (at.end ? at.confirming : kEvidence))
      at = {.known = true, .end = is_end, .confirming = kEvidence};
  }
  if (!stamped_at_.end)
    return begin;
  if (stamped_at_.confirming == kEvidence)
    doubt(CloudDoubt::stamp_at_end, arrival);
  return begin - (end - header);
}

std::optional<Stamp> CloudDecoder::on_host_clock(Stamp begin, Duration length, Stamp arrival) {
  constexpr Duration kClearly = std::chrono::milliseconds{500}, kTai = std::chrono::seconds{37};
  const std::optional<Stamp> end = clock_.on_host_clock(begin + length, arrival);
  counters_.clock_steps = clock_.steps();
  if (!end)
    return std::nullopt;
  const Duration offset = clock_.offset();
  if (std::chrono::abs(offset - kTai) < 2 * kClearly)
    doubt(CloudDoubt::tai, arrival);
  else if (std::chrono::abs(offset) > kClearly)
    doubt(offset > Duration{} ? CloudDoubt::ahead : CloudDoubt::behind, arrival);
  return *end - length;
}

/// Measures the period, and finds stamps that do not advance. Once they may stand still: where the header's stamp is
/// found to be that of the other end, see stamped_at_begin().
void CloudDecoder::measure_period(Stamp arrival) {
  constexpr Duration kShortest = std::chrono::milliseconds{5};
  constexpr int kMemory = 8, kEvidence = 3;
  const Duration since = last_begin_ ? cloud_.begin - *last_begin_ : Duration{};
  standing_still_ = last_begin_ && since <= Duration{} ? standing_still_ + 1 : 0;
  if (since < -kShortest || standing_still_ >= kEvidence)
    doubt(CloudDoubt::backwards, arrival);
  if (last_begin_ && since <= Duration{})
    ++counters_.reordered;
  else if (since > kShortest && since < kLongestCloud) // a longer interval means a lost cloud
    period_ = period_is_known_ ? period_ + (std::min(since, period_ * 3 / 2) - period_) / kMemory : since;
  period_is_known_ = period_is_known_ || (since > kShortest && since < kLongestCloud);
  last_begin_ = cloud_.begin;
}

/// Sorts by time with a counting sort, stable within a bucket.
void CloudDecoder::sort_by_time() {
  const std::size_t count = points_.offset_ns.size();
  const std::size_t buckets = std::min(kMaxBuckets, kBucketsPerPoint * count);
  const auto length_ns = static_cast<std::uint64_t>((cloud_.end - cloud_.begin).count());
  const auto bucket_of = [&](std::size_t i) {
    return static_cast<std::size_t>(static_cast<std::uint64_t>(points_.offset_ns[i]) * buckets / length_ns);
  };
  buckets_.assign(buckets + 1, 0U);
  for (std::size_t i = 0; i < count; ++i)
    ++buckets_[bucket_of(i) + 1];
  std::partial_sum(buckets_.begin(), buckets_.end(), buckets_.begin());
  points_.order.resize(count);
  for (std::size_t i = 0; i < count; ++i)
    points_.order[buckets_[bucket_of(i)]++] = static_cast<std::uint32_t>(i);
}

const LidarPacket* CloudDecoder::next() {
  const std::size_t count = points_.order.size();
  if (next_ >= std::max<std::size_t>(count, 1))
    return nullptr;
  const auto offset = [&](std::size_t place) { return points_.offset_ns[points_.order[place]]; };
  const std::int32_t begin_ns = count > 0 ? offset(next_) : 0;
  std::int32_t last_ns = begin_ns;
  packet_.cloud = cloud_;
  packet_.stamp = count > 0 ? zero_ + Duration{begin_ns} : cloud_.begin;
  packet_.count = 0;
  open_.fill(nullptr);
  for (; next_ < count && offset(next_) - begin_ns < kLongestSlice.count(); ++next_) {
    const std::size_t point = points_.order[next_];
    FiringGroup* const group = group_for(points_.laser[point]);
    if (group == nullptr)
      break;
    add_point(point, *group, begin_ns);
    last_ns = std::max(last_ns, points_.offset_ns[point]);
  }
  next_ += count == 0 ? 1 : 0;
  const Stamp after = next_ < count ? zero_ + Duration{std::max(offset(next_), last_ns + 1)} : cloud_.end;
  packet_.duration = after - packet_.stamp;
  packet_.cloud->ends_here = next_ >= count;
  const double turned = to_seconds(packet_.stamp - cloud_.begin) / to_seconds(period_);
  packet_.first_azimuth_cdeg = static_cast<std::uint16_t>((turned - std::floor(turned)) * (kCdegPerTurn - 1));
  return &packet_;
}

/// Returns the group for the next return of a laser; nullptr if the packet is full.
FiringGroup* CloudDecoder::group_for(std::size_t laser) {
  FiringGroup*& group = open_[laser / FiringGroup::kLasers];
  if (group != nullptr && group->range_m[laser % FiringGroup::kLasers] == 0.0F)
    return group;
  if (packet_.count == LidarPacket::kMaxFiringGroups)
    return nullptr;
  group = &packet_.storage[packet_.count++];
  *group = {};
  group->first_laser = static_cast<std::uint8_t>(laser / FiringGroup::kLasers * FiringGroup::kLasers);
  for (std::size_t k = 0; k < FiringGroup::kLasers; ++k)
    group->ring[k] = rings_.ring_of(group->first_laser + k);
  return group;
}

void CloudDecoder::add_point(std::size_t point, FiringGroup& group, std::int32_t begin_ns) const {
  constexpr float kMaxIntensity = 255.0F;
  const std::size_t k = points_.laser[point] % FiringGroup::kLasers;
  const float x = points_.x_m[point], y = points_.y_m[point], z = points_.z_m[point];
  group.x_m[k] = x;
  group.y_m[k] = y;
  group.z_m[k] = z;
  group.range_m[k] = std::sqrt(x * x + y * y + z * z);
  group.offset_ns[k] = points_.offset_ns[point] - begin_ns;
  const float intensity = points_.intensity.empty() ? 0.0F : points_.intensity[point];
  group.intensity[k] = static_cast<std::uint8_t>(intensity > 0.0F ? std::min(intensity, kMaxIntensity) : 0.0F);
}

} // namespace locus
