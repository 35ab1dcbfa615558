// SPDX-License-Identifier: Apache-2.0
#include "drivers/clouds/cloud_decoder.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <functional>
#include <numeric>
#include <string_view>

namespace locus {

namespace {

constexpr Duration kLongestSlice = std::chrono::microseconds{1330}; ///< duration of a VLP-16 packet
/// Resolution of the sort by time: a sixteenth of the mean interval between points, or 1/65536 of the cloud if that is
/// longer.
constexpr std::size_t kBucketsPerPoint = 16;
constexpr std::size_t kMaxBuckets = std::size_t{1} << 16;
constexpr double kCdegPerTurn = 36000;

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
