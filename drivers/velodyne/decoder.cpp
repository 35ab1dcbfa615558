// SPDX-License-Identifier: Apache-2.0
#include "drivers/velodyne/decoder.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <fmt/format.h>

#include "drivers/wire.hpp"

namespace locus::velodyne {

namespace {

constexpr double kRadPerCdeg = std::numbers::pi / 18000.0;
constexpr Duration kHour = std::chrono::hours{1};

/// Limit for the turn rate: three times the fastest setting of any model, 1200 rpm. A first VLP-16 packet mistaken for
/// an HDL-32E, whose columns are shorter, seems to turn 2.4 times as fast and must not be rejected for that.
constexpr double kMaxTurnCdegPerNs = 3.0 * 20.0 * kCdegPerTurn * 1e-9;

/// Least turn rate from which time can be derived: half the slowest setting of any model, 300 rpm.
constexpr double kMinTurnCdegPerNs = 0.5 * 5.0 * kCdegPerTurn * 1e-9;

/// Longest time between two packets for measuring the turn of the VLS-128: three fifths of a turn at 3600 rpm.
constexpr Duration kMaxTurnGap = std::chrono::milliseconds{10};

const std::byte* block_at(std::span<const std::byte, kDataPacketBytes> packet, std::size_t block) {
  return packet.data() + block * kBlockBytes;
}

std::uint16_t flag_of(const std::byte* block) { return read_u16(block); }
std::uint16_t azimuth_of(const std::byte* block) { return read_u16(block + 2); }
const std::byte* channel_at(const std::byte* block, std::size_t channel) {
  return block + kBlockHeaderBytes + channel * kChannelBytes;
}

int clockwise_turn(std::uint16_t from_cdeg, std::uint16_t to_cdeg) {
  const int turn = int{to_cdeg} - int{from_cdeg};
  return turn < 0 ? turn + kCdegPerTurn : turn;
}

} // namespace

std::string to_string(const UnknownPackets& unknown) {
  return fmt::format("product id 0x{:02x} and return mode 0x{:02x} in {} packets", unknown.product_id,
                     unknown.return_mode, unknown.packets);
}

std::optional<PacketError> Decoder::decode(std::span<const std::byte> payload, LidarPacket& packet) {
  if (payload.size() != kDataPacketBytes)
    return PacketError::length;
  const auto bytes = payload.first<kDataPacketBytes>();
  // Some lidars do not wrap at the hour; SensorClock rejects a lone wrong time.
  const Duration stamp = std::chrono::microseconds{read_u32(payload.data() + kTimeOffset)} % kHour;
  if (const auto error = recognise(bytes, stamp))
    return error;
  if (const auto error = check_blocks(bytes))
    return error;
  if (!measure_turns(bytes, stamp))
    return PacketError::azimuth;

  packet.count = 0;
  for (std::size_t column = 0; column < layout_.columns; ++column) {
    const double azimuth_rad = kRadPerCdeg * azimuth_cdeg_[column];
    column_azimuth_ = {static_cast<float>(std::cos(azimuth_rad)), static_cast<float>(std::sin(azimuth_rad)),
                       static_cast<float>(kRadPerCdeg) * turn_cdeg_[column]};
    for (std::size_t firing = 0; firing < layout_.banks * kChannels; firing += FiringGroup::kLasers)
      read_firing_groups(bytes, column, firing, packet);
  }
  time_of_hour_ = (stamp + kHour - spec(*model_, pace_).stamp_delay) % kHour;
  packet.duration = duration_;
  packet.first_azimuth_cdeg = azimuth_cdeg_.front();
  return std::nullopt;
}

double Decoder::rotation_rate_rpm() const {
  if (column_duration_ == Duration{})
    return 0.0;
  return 60.0 * static_cast<double>(mean_turn_cdeg_) / kCdegPerTurn / to_seconds(column_duration_);
}

std::optional<PacketError> Decoder::recognise(Packet packet, Duration stamp) {
  const auto spacing = last_recognised_ ? std::optional{stamp - *last_recognised_} : std::nullopt;
  const auto mode = options_.return_mode
                        ? options_.return_mode
                        : return_mode_from_byte(std::to_integer<std::uint8_t>(packet[kReturnModeOffset]));
  if (!mode)
    return refuse_unknown(packet);
  recognised_ = model_from_product_id(std::to_integer<std::uint8_t>(packet[kProductIdOffset]));
  if (recognised_)
    recognised_ = recognition_.recognise(*recognised_, *mode, spacing, packet);
  const auto model = options_.model ? options_.model : recognised_;
  if (!model)
    return refuse_unknown(packet);
  last_recognised_ = stamp;
  const Pace pace = pace_recognition_.recognise(*model, *mode, spacing);
  if (model == model_ && mode == mode_ && pace == pace_)
    return std::nullopt;
  const Calibration& own = spec(*model).calibration;
  if (options_.calibration && options_.calibration->laser_count != own.laser_count)
    return PacketError::model;
  prepare(*model, *mode, pace, options_.calibration ? *options_.calibration : own);
  return std::nullopt;
}

PacketError Decoder::refuse_unknown(Packet packet) {
  const auto product_id = std::to_integer<std::uint8_t>(packet[kProductIdOffset]);
  const auto mode = std::to_integer<std::uint8_t>(packet[kReturnModeOffset]);
  unknown_[product_id] = {product_id, mode, unknown_[product_id].packets + 1};
  return PacketError::model;
}

std::optional<UnknownPackets> Decoder::unknown_packets() const {
  const UnknownPackets most = *std::ranges::max_element(unknown_, {}, &UnknownPackets::packets);
  return most.packets > 0 ? std::optional{most} : std::nullopt;
}

void Decoder::prepare(Model model, ReturnMode mode, Pace pace, const Calibration& calibration) {
  model_ = model;
  mode_ = mode;
  pace_ = pace;
  layout_ = packet_layout(model, mode);
  column_duration_ = spec(model, pace).column_duration;
  distance_resolution_m_ = static_cast<float>(calibration.distance_resolution_m);
  last_stamp_.reset();
  mean_turn_cdeg_ = 0.0F;

  const std::span<const Firing> firings = spec(model, pace).firings();
  for (std::size_t i = 0; i < firings.size(); ++i) {
    const Laser& laser = calibration.storage[firings[i].laser];
    firings_.share_of_column[i] =
        static_cast<float>(firings[i].offset_ns) / static_cast<float>(column_duration_.count());
    firings_.point(i, laser.elevation_rad, laser.azimuth_offset_rad);
    firings_.range_offset_m[i] = static_cast<float>(laser.range_offset_m);
    firings_.radial_offset_m[i] = static_cast<float>(laser.radial_offset_m);
    firings_.lateral_offset_m[i] = static_cast<float>(laser.lateral_offset_m);
    firings_.vertical_offset_m[i] = static_cast<float>(laser.vertical_offset_m);
    firings_.offset_ns[i] = firings[i].offset_ns;
    firings_.ring[i] = laser.ring;
    firings_.laser[i] = firings[i].laser;
  }
}

std::optional<PacketError> Decoder::check_blocks(Packet packet) const {
  for (std::size_t i = 0; i < layout_.used_blocks(); ++i) {
    const std::byte* block = block_at(packet, i);
    if (flag_of(block) != kBankFlags[i % layout_.blocks_per_column() / layout_.returns])
      return PacketError::flag;
    if (azimuth_of(block) > kCdegPerTurn) // 360.00 itself occurs occasionally
      return PacketError::azimuth;
  }
  return std::nullopt;
}

/// Computes azimuth, turn and time of every column. Fails if most turns are impossible.
bool Decoder::measure_turns(Packet packet, Duration stamp) {
  const double max_turn_cdeg = kMaxTurnCdegPerNs * static_cast<double>(column_duration_.count());
  const std::size_t columns = layout_.columns;
  std::array<bool, kBlocks> is_possible{};
  int possible = 0;
  int sum_cdeg = 0;
  for (std::size_t column = 0; column < columns; ++column) {
    azimuth_cdeg_[column] = azimuth_of(block_at(packet, column * layout_.blocks_per_column())) % kCdegPerTurn;
    if (column == 0)
      continue;
    const int turn_cdeg = clockwise_turn(azimuth_cdeg_[column - 1], azimuth_cdeg_[column]);
    turn_cdeg_[column - 1] = static_cast<float>(turn_cdeg);
    is_possible[column - 1] = turn_cdeg <= max_turn_cdeg;
    possible += is_possible[column - 1] ? 1 : 0;
    sum_cdeg += is_possible[column - 1] ? turn_cdeg : 0;
  }
  const int impossible = static_cast<int>(columns) - 1 - possible;
  if (impossible > possible)
    return false;
  if (columns > 1)
    mean_turn_cdeg_ = static_cast<float>(sum_cdeg) / static_cast<float>(possible);
  else
    measure_turn_since_last_packet(stamp, max_turn_cdeg);

  const bool turns =
      static_cast<double>(mean_turn_cdeg_) >= kMinTurnCdegPerNs * static_cast<double>(column_duration_.count());
  std::int64_t columns_passed = 0;
  for (std::size_t column = 0; column < columns; ++column) {
    column_offset_ns_[column] = static_cast<std::int32_t>(columns_passed * column_duration_.count());
    const bool skips_blind_sector = !is_possible[column] && column + 1 < columns && impossible == 1 && turns;
    columns_passed += skips_blind_sector ? std::lround(turn_cdeg_[column] / mean_turn_cdeg_) : 1;
    if (!is_possible[column])
      turn_cdeg_[column] = mean_turn_cdeg_;
  }
  duration_ = columns_passed * column_duration_;
  return true;
}

void Decoder::measure_turn_since_last_packet(Duration stamp, double max_turn_cdeg) {
  if (last_stamp_ && stamp > *last_stamp_ && stamp - *last_stamp_ < kMaxTurnGap) {
    const double turn_cdeg = clockwise_turn(last_azimuth_cdeg_, azimuth_cdeg_.front()) *
                             (to_seconds(column_duration_) / to_seconds(stamp - *last_stamp_));
    if (turn_cdeg <= max_turn_cdeg)
      mean_turn_cdeg_ = static_cast<float>(turn_cdeg);
  }
  last_stamp_ = stamp;
  last_azimuth_cdeg_ = azimuth_cdeg_.front();
}

/// Appends the firing groups of sixteen firings of a column; in dual return mode, one group for each echo. A second
/// echo at the distance of the first is not a return.
void Decoder::read_firing_groups(Packet packet, std::size_t column, std::size_t first_firing, LidarPacket& out) const {
  const std::size_t bank = first_firing / kChannels;
  const std::byte* block = block_at(packet, column * layout_.blocks_per_column() + bank * layout_.returns);
  Aim aim;
  run_as(options_.isa, [&] { aim = aim_at(firings_, column_azimuth_, first_firing); });
  Distances previous{}; // 0 is no return, so a first echo equal to it loses nothing
  for (std::size_t echo = 0; echo < layout_.returns; ++echo) {
    FiringGroup& group = out.storage[out.count++];
    Distances distances;
    for (std::size_t k = 0; k < FiringGroup::kLasers; ++k) {
      const std::byte* at = channel_at(block + echo * kBlockBytes, first_firing % kChannels + k);
      distances[k] = read_u16(at);
      group.intensity[k] = std::to_integer<std::uint8_t>(at[2]);
    }
    run_as(options_.isa, [&] { place(distances, previous, aim, column, first_firing, group); });
    previous = distances;
  }
}

/// Computes the firing group from its distances. Works on a local copy, because possible aliasing of input and output
/// would prevent vectorisation.
[[gnu::always_inline]] inline void Decoder::place(const Distances& distances, const Distances& previous, const Aim& aim,
                                                  std::size_t column, std::size_t first_firing,
                                                  FiringGroup& group) const {
  FiringGroup placed;
  for (std::size_t k = 0; k < FiringGroup::kLasers; ++k) {
    const std::size_t i = first_firing + k;
    const float range_m = static_cast<float>(distances[k]) * distance_resolution_m_ + firings_.range_offset_m[i];
    const float radial_m = range_m * firings_.cos_elevation[i] + firings_.radial_offset_m[i];
    const float lateral_m = firings_.lateral_offset_m[i];
    placed.x_m[k] = radial_m * aim.cos_azimuth[k] + lateral_m * aim.sin_azimuth[k];
    placed.y_m[k] = lateral_m * aim.cos_azimuth[k] - radial_m * aim.sin_azimuth[k];
    placed.z_m[k] = range_m * firings_.sin_elevation[i] + firings_.vertical_offset_m[i];
    const std::int32_t is_return = -(distances[k] != 0) & -(distances[k] != previous[k]) & -(range_m > 0.0F);
    placed.range_m[k] = is_return != 0 ? range_m : 0.0F;
    placed.offset_ns[k] = column_offset_ns_[column] + firings_.offset_ns[i];
  }
  group.first_laser = firings_.laser[first_firing];
  group.x_m = placed.x_m;
  group.y_m = placed.y_m;
  group.z_m = placed.z_m;
  group.range_m = placed.range_m;
  group.offset_ns = placed.offset_ns;
  for (std::size_t k = 0; k < FiringGroup::kLasers; ++k)
    group.ring[k] = firings_.ring[first_firing + k];
}

} // namespace locus::velodyne
