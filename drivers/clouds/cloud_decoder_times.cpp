// SPDX-License-Identifier: Apache-2.0
// Times of a cloud: of each point, of the whole cloud on the host's clock, and from one cloud to the next.
#include <algorithm>
#include <array>
#include <bitset>
#include <cmath>
#include <numbers>
#include <utility>

#include "drivers/clouds/cloud_decoder.hpp"

namespace locus {

namespace {

/// Span of the firings of a cloud of one instant. They need an order, from which the neighbours of a point on other
/// rings are found; a robot moves by less than the lidar's noise in this time.
constexpr Duration kInstant = std::chrono::microseconds{50};
constexpr double kTurn_rad = 2 * std::numbers::pi;

/// Least number of points from which the time unit can be estimated.
constexpr std::size_t kFewPoints = 100;

double azimuth_rad(float x_m, float y_m) { return std::atan2(static_cast<double>(y_m), static_cast<double>(x_m)); }

} // namespace

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

} // namespace locus
