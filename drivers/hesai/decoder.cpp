// SPDX-License-Identifier: Apache-2.0
#include "drivers/hesai/decoder.hpp"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <numbers>

#include "drivers/hesai/packet_parts.hpp"
#include "drivers/wire.hpp"

namespace locus::hesai {

namespace {

constexpr double kRadPerCdeg = std::numbers::pi / 18000.0;
constexpr double kCdegPerSecondAtOneRpm = kCdegPerTurn / 60.0;

/// Limit for the motor speed: three times the fastest setting of any model, 1200 rpm.
constexpr double kMaxRpm = 3600.0;

/// Least motor speed from which time can be derived: half the slowest setting of any model, 300 rpm.
constexpr double kMinRpm = 150.0;

/// Longest time between two packets for measuring the direction of rotation: 36 degrees at 1200 rpm.
constexpr Duration kMaxGap = std::chrono::milliseconds{5};

/// Returns the shorter turn between two azimuths, clockwise positive.
int turn_between(std::uint16_t from_cdeg, std::uint16_t to_cdeg) {
  const int turn = (int{to_cdeg} - int{from_cdeg} + kCdegPerTurn) % kCdegPerTurn;
  return turn > kCdegPerTurn / 2 ? turn - kCdegPerTurn : turn;
}

/// Cosine and sine of successive column azimuths; a small step is computed from the previous azimuth.
class ColumnDirection {
 public:
  void turn_to(std::uint16_t azimuth_cdeg) {
    constexpr int kNear_cdeg = 200; // the omitted terms are below 1e-10
    const int turn_cdeg = turn_between(azimuth_cdeg_, azimuth_cdeg);
    azimuth_cdeg_ = azimuth_cdeg;
    if (!is_known_ || std::abs(turn_cdeg) > kNear_cdeg) {
      is_known_ = true;
      cos_ = std::cos(kRadPerCdeg * azimuth_cdeg);
      sin_ = std::sin(kRadPerCdeg * azimuth_cdeg);
      return;
    }
    const double angle = kRadPerCdeg * turn_cdeg, square = angle * angle;
    const double cos_turn = 1.0 - square * (0.5 - square / 24.0), sin_turn = angle * (1.0 - square / 6.0);
    const double cos_before = cos_;
    cos_ = cos_before * cos_turn - sin_ * sin_turn;
    sin_ = sin_ * cos_turn + cos_before * sin_turn;
  }
  [[nodiscard]] ColumnAzimuth with(double turn_rad) const {
    return {static_cast<float>(cos_), static_cast<float>(sin_), static_cast<float>(turn_rad)};
  }

 private:
  bool is_known_ = false;
  std::uint16_t azimuth_cdeg_ = 0;
  double cos_ = 1.0, sin_ = 0.0;
};

constexpr FiringGroup::PerLaser<std::int32_t> kNone{}; ///< 0 is no return, so a return equal to it loses nothing

/// Returns true if sixteen channels are zero in all blocks of a column.
bool is_empty(const std::byte* bank, const PacketLayout& layout, std::size_t returns) {
  std::uint64_t any = 0;
  for (std::size_t echo = 0; echo < returns; ++echo, bank += layout.block())
    for (std::size_t at = 0; at < FiringGroup::kLasers * layout.channel; at += sizeof(any))
      any |= read_u64(bank + at);
  return any == 0;
}

template <std::size_t kStep>
void read_channels(const std::byte* at, std::size_t count, FiringGroup::PerLaser<std::int32_t>& distances,
                   FiringGroup::PerLaser<std::uint8_t>& intensity) {
  if (count == FiringGroup::kLasers)
    count = FiringGroup::kLasers; // compile-time constant: lets the compiler specialise the loop
  for (std::size_t k = 0; k < count; ++k) {
    distances[k] = read_u16(at + k * kStep);
    intensity[k] = std::to_integer<std::uint8_t>(at[k * kStep + 2]);
  }
}

/// Reads channels of `bytes` bytes each.
void read_channels(const std::byte* at, std::size_t bytes, std::size_t count,
                   FiringGroup::PerLaser<std::int32_t>& distances, FiringGroup::PerLaser<std::uint8_t>& intensity) {
  if (bytes == 4)
    read_channels<4>(at, count, distances, intensity);
  else
    read_channels<3>(at, count, distances, intensity);
}

} // namespace

std::optional<PacketError> Decoder::decode(std::span<const std::byte> payload, LidarPacket& packet) {
  recognised_ = look_at(payload);
  Heading heading{};
  if (const auto error = read_heading(payload, heading))
    return error;
  if (const auto error = find_columns(payload, heading))
    return error;
  if (model_ != heading.model)
    prepare(heading.model);
  const ModelSpec& its = *heading.spec;
  mode_ = heading.mode;
  distance_unit_m_ = heading.distance_unit_m;
  least_distance_ = std::max(1, static_cast<int>(std::ceil(its.least_range_m / distance_unit_m_ - 1e-3F)));
  motor_rpm_ = heading.motor_rpm;
  packet_bytes_ = payload.size();
  has_checksums_ = heading.has_right_sums;
  sequence_ = sequence_of(payload, heading, 0);
  const Duration to_first_column =
      its.azimuth_delay - Duration{its.time_of_last_column ? columns_.offset_ns[columns_.count - 1] : 0};
  const Duration first_firing{first_firing_ns_[sequence_]};
  measure_direction(heading.time);
  time_ = heading.time + to_first_column + first_firing;
  number_.reset();
  if (heading.has_number)
    number_ = read_u32(payload.data() + heading.tail + its.layout.tail.bytes);

  packet.count = 0;
  const double turn_rad = direction_ * kRadPerCdeg * kCdegPerSecondAtOneRpm * motor_rpm_ *
                          to_seconds(its.sequences[sequence_].column_duration);
  ColumnDirection direction;
  for (std::size_t column = 0; column < columns_.count; ++column) {
    direction.turn_to(columns_.azimuth_cdeg[column]);
    read_column(payload, heading, column, direction.with(turn_rad), packet);
  }
  packet.duration = columns_.duration;
  const int azimuth_cdeg = columns_.azimuth_cdeg.front();
  packet.first_azimuth_cdeg = static_cast<std::uint16_t>((kCdegPerTurn + direction_ * azimuth_cdeg) % kCdegPerTurn);
  return std::nullopt;
}

Duration Decoder::nominal_duration() const { return model_ ? packet_duration(*model_, *mode_, sequence_) : Duration{}; }

std::optional<PacketError> Decoder::read_heading(Packet packet, Heading& heading) const {
  if (!recognised_)
    return PacketError::flag;
  const auto model = options_.model ? options_.model : recognised_->model;
  if (!model || !has_layout_of(*model, packet))
    return PacketError::model;
  const ModelSpec& its = spec(*model);
  const TailLayout& tail = its.layout.tail;
  const auto parts = parts_of(its, packet);
  if (!parts)
    return PacketError::length;
  heading.tail = parts->tail;
  heading.has_number = parts->has_number;
  const std::byte* const at = packet.data() + heading.tail;
  const auto mode = return_mode_from_byte(std::to_integer<std::uint8_t>(at[tail.return_mode]));
  const std::size_t lasers = options_.calibration ? options_.calibration->laser_count : its.layout.channels;
  if (!mode || its.layout.blocks % returns_of(*mode) != 0 || lasers != its.layout.channels)
    return PacketError::model;
  const unsigned unit_mm = distance_unit_mm(its.layout, packet);
  heading.model = *model;
  heading.spec = &its;
  heading.mode = *mode;
  heading.distance_unit_m = 1e-3F * static_cast<float>(unit_mm);
  heading.motor_rpm = read_u16(at + tail.motor_speed);
  if (unit_mm == 0)
    return PacketError::model;
  if (heading.motor_rpm > kMaxRpm)
    return PacketError::azimuth;
  const auto time = read_time(at, tail);
  if (!time)
    return PacketError::time;
  heading.time = *time;
  heading.has_right_sums = its.layout.has_checksums && has_right_checksums(its, *parts, packet);
  return has_checksums_ && model_ == model && !heading.has_right_sums ? std::optional{PacketError::checksum}
                                                                      : std::nullopt;
}

/// Computes azimuth and time of every column. Fails if an azimuth exceeds the circle or most turns are impossible.
std::optional<PacketError> Decoder::find_columns(Packet packet, const Heading& heading) {
  const ModelSpec& its = *heading.spec;
  const std::size_t returns = returns_of(heading.mode);
  const std::size_t sequence = sequence_of(packet, heading, 0);
  const Duration column_duration = its.sequences[sequence].column_duration;
  const double column_s = to_seconds(column_duration);
  const double most_cdeg = kMaxRpm * kCdegPerSecondAtOneRpm * column_s;
  const double turn_cdeg = heading.motor_rpm * kCdegPerSecondAtOneRpm * column_s;
  Columns found;
  found.count = its.layout.blocks / returns;
  int possible = 0, sum_cdeg = 0;
  std::array<int, kMaxBlocks> turns_cdeg{};
  const std::byte* at = packet.data() + its.layout.header;
  for (std::size_t column = 0; column < found.count; ++column) {
    const std::uint16_t azimuth_cdeg = read_u16(at + its.layout.block_header - 2);
    for (std::size_t echo = 0; echo < returns; ++echo, at += its.layout.block()) {
      if (its.layout.block_header == 4 && read_u16(at) != 0xEEFF)
        return PacketError::flag;
      if (read_u16(at + its.layout.block_header - 2) > kCdegPerTurn)
        return PacketError::azimuth;
    }
    found.azimuth_cdeg[column] = azimuth_cdeg % kCdegPerTurn;
    if (column == 0)
      continue;
    turns_cdeg[column] = turn_between(found.azimuth_cdeg[column - 1], found.azimuth_cdeg[column]);
    if (std::abs(turns_cdeg[column]) <= most_cdeg) {
      ++possible;
      sum_cdeg += turns_cdeg[column];
    }
  }
  const int impossible = static_cast<int>(found.count) - 1 - possible;
  // A packet of two columns has only one turn, so a correct checksum is required to trust the azimuths.
  const bool has_blind_sector =
      impossible == 1 && heading.motor_rpm >= kMinRpm && (possible > 0 || heading.has_right_sums);
  if (impossible > possible && !has_blind_sector)
    return PacketError::azimuth;
  const int direction = sum_cdeg == 0 ? direction_ : sum_cdeg > 0 ? 1 : -1;
  std::int64_t passed = 0;
  for (std::size_t column = 1; column < found.count; ++column) {
    const bool skips_blind_sector = has_blind_sector && std::abs(turns_cdeg[column]) > most_cdeg;
    const int turned_cdeg = (direction * turns_cdeg[column] + kCdegPerTurn) % kCdegPerTurn;
    passed += skips_blind_sector ? std::lround(turned_cdeg / turn_cdeg) : 1;
    found.offset_ns[column] = static_cast<std::int32_t>(passed * column_duration.count());
  }
  found.duration = (passed + 1) * column_duration;
  columns_ = found;
  if (found.count > 1)
    direction_ = direction;
  return std::nullopt;
}

/// Updates the direction of rotation from successive packets, if they have a single column.
void Decoder::measure_direction(Duration time) {
  const std::uint16_t azimuth_cdeg = columns_.azimuth_cdeg[columns_.count - 1];
  if (columns_.count == 1 && last_time_ && time > *last_time_ && time - *last_time_ < kMaxGap) {
    const int turn_cdeg = turn_between(last_azimuth_cdeg_, azimuth_cdeg);
    const double most_cdeg = kMaxRpm * kCdegPerSecondAtOneRpm * to_seconds(time - *last_time_);
    if (turn_cdeg != 0 && std::abs(turn_cdeg) <= most_cdeg)
      direction_ = turn_cdeg > 0 ? 1 : -1;
  }
  last_time_ = time;
  last_azimuth_cdeg_ = azimuth_cdeg;
}

void Decoder::prepare(Model model) {
  model_ = model;
  const ModelSpec& its = spec(model);
  const Calibration& calibration = options_.calibration ? *options_.calibration : its.calibration;
  for (std::size_t sequence = 0; sequence < beams_.size(); ++sequence) {
    const FiringSequence& from = its.sequences[sequence];
    SpinningBeams& beams = beams_[sequence];
    const auto end = from.offset_ns.begin() + static_cast<std::ptrdiff_t>(its.layout.channels);
    first_firing_ns_[sequence] = *std::min_element(from.offset_ns.begin(), end);
    for (std::size_t i = 0; i < its.layout.channels; ++i) {
      const Laser& laser = calibration.storage[i];
      beams.share_of_column[i] =
          static_cast<float>(from.offset_ns[i]) / static_cast<float>(from.column_duration.count());
      beams.point(i, laser.elevation_rad, laser.azimuth_offset_rad);
      beams.offset_ns[i] = from.offset_ns[i] - first_firing_ns_[sequence];
      beams.ring[i] = laser.ring;
    }
  }
}

std::size_t Decoder::sequence_of(Packet packet, const Heading& heading, std::size_t column) {
  constexpr std::size_t kModeFlag = 5, kOperationalState = 11;
  const auto field = [&](std::size_t at) { return std::to_integer<std::size_t>(packet[heading.tail + at]); };
  switch (heading.spec->sequence_from) {
  case SequenceFrom::mode_flag:
    return (field(kModeFlag) + 1 + column) % 2;
  case SequenceFrom::operational_state:
    return field(kOperationalState) == 0 ? 1 : 0;
  case SequenceFrom::only_one:
    break;
  }
  return 0;
}

/// Appends the firing groups of a column: for each sixteen channels, one group for each return.
void Decoder::read_column(Packet packet, const Heading& heading, std::size_t column, const ColumnAzimuth& azimuth,
                          LidarPacket& out) const {
  const PacketLayout& layout = heading.spec->layout;
  const std::size_t returns = returns_of(heading.mode);
  const std::size_t sequence = sequence_of(packet, heading, column);
  const SpinningBeams& beams = beams_[sequence];
  const std::int32_t offset_ns = columns_.offset_ns[column] + first_firing_ns_[sequence] - first_firing_ns_[sequence_];
  const std::byte* const blocks = packet.data() + layout.header + column * returns * layout.block();
  const std::uint8_t silent_banks = heading.spec->sequences[sequence].silent_banks;
  for (std::size_t first = 0; first < layout.channels; first += FiringGroup::kLasers) {
    const std::byte* const bank = blocks + layout.block_header + first * layout.channel;
    if ((silent_banks >> first / FiringGroup::kLasers & 1U) != 0 && is_empty(bank, layout, returns))
      continue;
    const std::size_t lasers = std::min(FiringGroup::kLasers, layout.channels - first);
    Aim aim;
    run_as(options_.isa, [&] { aim = aim_at(beams, azimuth, first); });
    std::array<Distances, kMaxReturns> distances;
    for (std::size_t echo = 0; echo < returns; ++echo) {
      FiringGroup& group = out.storage[out.count++];
      if (lasers < FiringGroup::kLasers)
        distances[echo].fill(0);
      read_channels(bank + echo * layout.block(), layout.channel, lasers, distances[echo], group.intensity);
      const Distances& before = echo > 0 ? distances[echo - 1] : kNone;
      const Distances& first_of_three = echo > 1 ? distances[0] : kNone;
      run_as(options_.isa, [&] { place(distances[echo], before, first_of_three, beams, aim, first, group); });
      for (std::size_t k = 0; k < FiringGroup::kLasers; ++k)
        group.offset_ns[k] = beams.offset_ns[first + k] + offset_ns;
    }
  }
}

/// Computes the positions of a firing group. A return at the same distance as another one of the pulse is discarded.
/// Works on a local copy, because possible aliasing of input and output would prevent vectorisation.
[[gnu::always_inline]] inline void Decoder::place(const Distances& distances, const Distances& another,
                                                  const Distances& one_more, const SpinningBeams& beams, const Aim& aim,
                                                  std::size_t first_channel, FiringGroup& group) const {
  FiringGroup placed;
  for (std::size_t k = 0; k < FiringGroup::kLasers; ++k) {
    const std::size_t i = first_channel + k;
    const float range_m = static_cast<float>(distances[k]) * distance_unit_m_;
    const float radial_m = range_m * beams.cos_elevation[i];
    placed.x_m[k] = radial_m * aim.cos_azimuth[k];
    placed.y_m[k] = -radial_m * aim.sin_azimuth[k];
    placed.z_m[k] = range_m * beams.sin_elevation[i];
    const std::int32_t is_return =
        -(distances[k] >= least_distance_) & -(distances[k] != another[k]) & -(distances[k] != one_more[k]);
    placed.range_m[k] = is_return != 0 ? range_m : 0.0F;
  }
  group.first_laser = static_cast<std::uint8_t>(first_channel);
  group.x_m = placed.x_m;
  group.y_m = placed.y_m;
  group.z_m = placed.z_m;
  group.range_m = placed.range_m;
  for (std::size_t k = 0; k < FiringGroup::kLasers; ++k)
    group.ring[k] = beams.ring[first_channel + k];
}

} // namespace locus::hesai
