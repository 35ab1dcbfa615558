// SPDX-License-Identifier: Apache-2.0
#include "drivers/ouster/decoder.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>

#include "drivers/ouster/checksum.hpp"
#include "drivers/wire.hpp"

namespace locus::ouster {

namespace {

constexpr int kFullTurn_cdeg = 36000;
constexpr float kMPerMm = 1e-3F;

/// Limit for the time span of a packet. 16 columns of the slowest mode, 512 columns at 10 Hz, take 3 ms.
constexpr Duration kLongestPacket = std::chrono::milliseconds{100};

/// Divisor of a turn that gives the tolerance of a measurement ID against the elapsed time.
constexpr std::size_t kTurnTolerance = 32;

/// Divisor of the column spacing of the mode that gives its tolerance.
constexpr std::int64_t kSpacingTolerance = 10;

} // namespace

Decoder::Decoder(const Metadata& metadata, Isa isa)
    : metadata_(metadata), format_(metadata.packet_format()), isa_(isa),
      column_duration_(from_seconds(1.0 / (metadata.frames_per_s * static_cast<double>(metadata.columns_per_frame)))),
      beam_origin_radius_m_(static_cast<float>(metadata.beam_origin_radius_m)),
      beam_origin_height_m_(static_cast<float>(metadata.beam_origin_height_m)),
      beam_origin_m_(static_cast<float>(std::hypot(metadata.beam_origin_radius_m, metadata.beam_origin_height_m))),
      encoder_(metadata.columns_per_frame),
      packets_per_turn_(sent_after(0, metadata.columns_per_frame / format_.columns_per_packet)) {
  aim_beams();
  for (std::size_t id = 0; id < encoder_.size(); ++id) {
    const double turned = 2.0 * std::numbers::pi * static_cast<double>(id) / static_cast<double>(encoder_.size());
    encoder_[id] = {static_cast<float>(std::cos(turned)), static_cast<float>(-std::sin(turned))};
  }
  const Eigen::Matrix3f R = metadata.T_sensor_lidar.R().cast<float>();
  const Eigen::Vector3f t = metadata.T_sensor_lidar.translation.cast<float>();
  for (std::size_t row = 0; row < 3; ++row) {
    const auto i = static_cast<Eigen::Index>(row);
    R_sensor_lidar_[row] = {R(i, 0), R(i, 1), R(i, 2)};
    t_sensor_lidar_[row] = t[i];
  }
  const double zero_cdeg = -std::atan2(static_cast<double>(R(1, 0)), static_cast<double>(R(0, 0))) / std::numbers::pi *
                           (0.5 * kFullTurn_cdeg);
  azimuth_zero_cdeg_ = static_cast<int>(std::lround(zero_cdeg)) + kFullTurn_cdeg;
}

/// Computes directions and rings of the beams. The uppermost beam is first; unused pixels of a first-generation sensor
/// all have the angle 0.
void Decoder::aim_beams() {
  const std::size_t pixels = metadata_.pixels_per_column;
  for (std::size_t i = 0; i < pixels; ++i) {
    const double altitude = metadata_.altitude_rad[i], azimuth = metadata_.azimuth_rad[i];
    beams_.x[i] = static_cast<float>(std::cos(altitude) * std::cos(azimuth));
    beams_.y[i] = static_cast<float>(-std::cos(altitude) * std::sin(azimuth));
    beams_.z[i] = static_cast<float>(std::sin(altitude));
  }
  PerPixel<std::uint8_t> upwards;
  const auto end = upwards.begin() + static_cast<std::ptrdiff_t>(pixels);
  std::iota(upwards.begin(), end, std::uint8_t{0});
  std::reverse(upwards.begin(), end);
  std::stable_sort(upwards.begin(), end, [&](std::uint8_t a, std::uint8_t b) {
    return metadata_.altitude_rad[a] < metadata_.altitude_rad[b];
  });
  for (std::size_t ring = 0; ring < pixels; ++ring)
    beams_.ring[upwards[ring]] = static_cast<std::uint8_t>(ring);
}

std::optional<PacketError> Decoder::decode(std::span<const std::byte> payload, LidarPacket& packet) {
  if (payload.size() != format_.packet_bytes)
    return PacketError::length;
  const PacketHeader header = format_.header(payload);
  if (header.packet_type != PacketHeader::kLidar)
    return PacketError::flag;
  if (header.serial_number != 0 && metadata_.serial_number != 0 && header.serial_number != metadata_.serial_number)
    return PacketError::sender;
  const bool has_right_sum = !format_.legacy && !format_.safety_header && has_right_checksum(payload);
  if (has_checksums_ && !has_right_sum)
    return PacketError::checksum;
  if (const auto error = find_columns(payload)) {
    if (error == PacketError::azimuth && header.init_id == other_start_.init_id)
      other_start_ = {}; // measurement IDs beyond the known mode: discard the evidence
    return error;
  }
  if (!has_known_mode(header)) {
    ++packets_of_other_start_;
    return PacketError::model;
  }

  packets_of_other_start_ = 0;
  has_checksums_ = has_right_sum;
  invalid_columns_ += columns_missing_;
  const Column& first = columns_.front();
  const Column& last = columns_[column_count_ - 1];
  time_ = time_of_packet_;
  first_column_ = first.measurement_id;
  last_column_ = last.measurement_id;
  const Duration spanned{last.offset_ns};
  if (spanned > Duration{})
    rotation_rate_rpm_ = 60.0 * static_cast<double>(columns_between(first_column_, last_column_)) /
                         static_cast<double>(metadata_.columns_per_frame) / to_seconds(spanned);
  packet.count = 0;
  for (std::size_t i = 0; i < column_count_; ++i)
    run_as(isa_, [&] { read_column(columns_[i], packet); });
  packet.duration = spanned + column_duration_;
  const auto turned_cdeg = static_cast<int>(first_column_ * kFullTurn_cdeg / metadata_.columns_per_frame);
  packet.first_azimuth_cdeg = static_cast<std::uint16_t>((azimuth_zero_cdeg_ + turned_cdeg) % kFullTurn_cdeg);
  return std::nullopt;
}

/// Finds the valid columns. Fails if a column is inconsistent with the first of them.
std::optional<PacketError> Decoder::find_columns(Packet payload) {
  column_count_ = 0;
  columns_missing_ = 0;
  const std::size_t turn = metadata_.columns_per_frame;
  std::size_t first_place = 0;
  for (std::size_t i = 0; i < format_.columns_per_packet; ++i) {
    const std::byte* const at = format_.column(payload.data(), i);
    const std::size_t id = PacketFormat::measurement_id_of(at);
    if (!format_.is_valid(at)) {
      columns_missing_ += is_in_window(id) ? 1U : 0U;
      continue;
    }
    if (id >= turn)
      return PacketError::azimuth;
    const std::uint64_t time_ns = PacketFormat::time_of(at);
    if (column_count_ == 0) {
      if (time_ns > static_cast<std::uint64_t>(to_ns(kLatestStamp)))
        return PacketError::time;
      time_of_packet_ = Duration{static_cast<Duration::rep>(time_ns)};
      first_place = i;
      columns_[column_count_++] = {at, id, 0};
      continue;
    }
    const std::uint64_t since_first_ns = time_ns - static_cast<std::uint64_t>(time_of_packet_.count());
    if (since_first_ns > static_cast<std::uint64_t>(kLongestPacket.count()) ||
        static_cast<std::int32_t>(since_first_ns) <= columns_[column_count_ - 1].offset_ns)
      return PacketError::time;
    if (id != (columns_.front().measurement_id + i - first_place) % turn)
      return PacketError::azimuth;
    columns_[column_count_++] = {at, id, static_cast<std::int32_t>(since_first_ns)};
  }
  return column_count_ == 0 ? std::optional{PacketError::flag} : std::nullopt;
}

/// Returns true if the packet comes from the known start of the sensor, or from one in the same mode: equal column
/// spacing, and measurement IDs that advance with time from one turn to the next.
bool Decoder::has_known_mode(const PacketHeader& header) {
  if (header.init_id == 0 || metadata_.init_id == 0 || header.init_id == metadata_.init_id)
    return true;
  const OtherStart before = other_start_;
  const auto frame_id = static_cast<std::uint16_t>(header.frame_id);
  other_start_ = {header.init_id, frame_id, columns_.front().measurement_id, time_of_packet_};
  const auto next_frame = static_cast<std::uint16_t>(before.frame_id + 1);
  if (before.init_id != header.init_id || frame_id != next_frame || !has_known_spacing())
    return false;
  // Time is not reduced modulo a turn: with twice the columns per turn, a missing half turn would go unnoticed.
  const auto turn = static_cast<std::int64_t>(metadata_.columns_per_frame);
  const auto turned = static_cast<std::int64_t>(columns_between(before.first_column, other_start_.first_column));
  const std::int64_t passed = (other_start_.time - before.time) / column_duration_;
  if (std::abs(passed - (turned == 0 ? turn : turned)) > turn / std::int64_t{kTurnTolerance})
    return false;
  metadata_.init_id = header.init_id;
  return true;
}

/// Returns true if the columns of the current packet have the spacing of the mode; false for a single column.
bool Decoder::has_known_spacing() const {
  const Column& last = columns_[column_count_ - 1];
  const std::size_t steps = columns_between(columns_.front().measurement_id, last.measurement_id);
  const std::int64_t expected_ns = static_cast<std::int64_t>(steps) * column_duration_.count();
  return steps > 0 && kSpacingTolerance * std::abs(last.offset_ns - expected_ns) <= expected_ns;
}

/// Number of columns from one measurement ID forward to another, modulo a turn.
std::size_t Decoder::columns_between(std::size_t from, std::size_t to) const {
  return (to + metadata_.columns_per_frame - from) % metadata_.columns_per_frame;
}

/// Counts the packets with a column in the window among the `packets` that follow `packet` in a turn.
std::uint64_t Decoder::sent_after(std::size_t packet, std::size_t packets) const {
  const std::size_t columns = format_.columns_per_packet, turn = metadata_.columns_per_frame / columns;
  std::uint64_t sent = 0;
  for (std::size_t next = packet + 1; next <= packet + packets; ++next) {
    const std::size_t first = next % turn * columns;
    bool is_sent = false;
    for (std::size_t id = first; id < first + columns && !is_sent; ++id)
      is_sent = is_in_window(id);
    sent += is_sent ? 1U : 0U;
  }
  return sent;
}

std::uint64_t Decoder::packets_between(std::size_t first_column_before, Duration advance) const {
  constexpr double kSpeedTolerance = 0.02;
  const std::size_t columns = format_.columns_per_packet, turn = metadata_.columns_per_frame / columns;
  const std::size_t before = first_column_before / columns, now = first_column_ / columns;
  const double by_time = to_seconds(advance) / (to_seconds(column_duration_) * static_cast<double>(columns));
  const auto by_id = static_cast<double>((now + turn - before) % turn);
  const double turns = std::max(0.0, std::round((by_time - by_id) / static_cast<double>(turn)));
  const double packets = by_id + turns * static_cast<double>(turn);
  if (packets < 1.0 || std::abs(packets - by_time) > 1.0 + kSpeedTolerance * by_time)
    return 0;
  const auto between = static_cast<std::size_t>(packets) - 1;
  return between / turn * sent_after(before, turn) + sent_after(before, between % turn);
}

bool Decoder::is_in_window(std::size_t id) const {
  const std::size_t turn = metadata_.columns_per_frame;
  return id < turn && (id + turn - metadata_.first_column) % turn < metadata_.columns_in_window();
}

[[gnu::always_inline]] inline Decoder::ColumnPose Decoder::pose_of(std::size_t id) const {
  const Turn turn = encoder_[id];
  ColumnPose pose;
  for (std::size_t row = 0; row < 3; ++row) {
    const auto& R = R_sensor_lidar_[row];
    pose.R[row] = {R[0] * turn.cos + R[1] * turn.sin, R[1] * turn.cos - R[0] * turn.sin, R[2]};
    pose.t[row] =
        pose.R[row][0] * beam_origin_radius_m_ + pose.R[row][2] * beam_origin_height_m_ + t_sensor_lidar_[row];
  }
  return pose;
}

/// Appends the firing groups of a column. A second return at the range of the first is discarded.
[[gnu::always_inline]] inline void Decoder::read_column(const Column& column, LidarPacket& out) const {
  const ColumnPose pose = pose_of(column.measurement_id);
  const ProfileSpec& profile = format_.profile;
  const std::byte* pixel = format_.pixels_of(column.at);
  const std::uint32_t mask = (1U << profile.range_bits) - 1;
  for (std::size_t first = 0; first < format_.pixels_per_column; first += FiringGroup::kLasers) {
    Ranges previous_mm{}; // 0 is no return, so a first return equal to it loses nothing
    for (std::size_t echo = 0; echo < profile.echoes; ++echo) {
      const auto [range_at, reflectivity_at] = profile.echo_fields[echo];
      FiringGroup& group = out.storage[out.count++];
      Ranges ranges_mm;
      for (std::size_t k = 0; k < FiringGroup::kLasers; ++k) {
        const std::byte* const at = pixel + k * profile.pixel_bytes;
        ranges_mm[k] = static_cast<std::int32_t>((read_u32(at + range_at) & mask) << profile.range_shift);
        group.intensity[k] = std::to_integer<std::uint8_t>(at[reflectivity_at]);
      }
      place(ranges_mm, previous_mm, pose, first, group);
      group.first_laser = static_cast<std::uint8_t>(first);
      group.offset_ns.fill(column.offset_ns);
      previous_mm = ranges_mm;
    }
    pixel += FiringGroup::kLasers * profile.pixel_bytes;
  }
}

/// Computes the firing group from its ranges. Works on a local copy, because possible aliasing of input and output
/// would prevent vectorisation.
[[gnu::always_inline]] inline void Decoder::place(const Ranges& ranges_mm, const Ranges& previous_mm,
                                                  const ColumnPose& pose, std::size_t first_pixel,
                                                  FiringGroup& group) const {
  FiringGroup placed;
  const auto& R = pose.R;
  const auto& t = pose.t;
  for (std::size_t k = 0; k < FiringGroup::kLasers; ++k) {
    const std::size_t i = first_pixel + k;
    const float range_m = static_cast<float>(ranges_mm[k]) * kMPerMm;
    const float along_m = range_m - beam_origin_m_;
    const float x = along_m * beams_.x[i], y = along_m * beams_.y[i], z = along_m * beams_.z[i];
    placed.x_m[k] = R[0][0] * x + R[0][1] * y + R[0][2] * z + t[0];
    placed.y_m[k] = R[1][0] * x + R[1][1] * y + R[1][2] * z + t[1];
    placed.z_m[k] = R[2][0] * x + R[2][1] * y + R[2][2] * z + t[2];
    const std::int32_t is_return = -(ranges_mm[k] != 0) & -(ranges_mm[k] != previous_mm[k]);
    placed.range_m[k] = is_return != 0 ? range_m : 0.0F;
  }
  group.x_m = placed.x_m;
  group.y_m = placed.y_m;
  group.z_m = placed.z_m;
  group.range_m = placed.range_m;
  for (std::size_t k = 0; k < FiringGroup::kLasers; ++k)
    group.ring[k] = beams_.ring[first_pixel + k];
}

} // namespace locus::ouster
