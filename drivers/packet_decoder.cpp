// SPDX-License-Identifier: Apache-2.0
#include "drivers/packet_decoder.hpp"

#include <algorithm>
#include <utility>

#include "drivers/hesai/calibration.hpp"
#include "drivers/ouster/imu_packet.hpp"
#include "drivers/velodyne/calibration.hpp"
#include "drivers/velodyne/position_packet.hpp"

namespace locus {

namespace {

/// Reads the calibration file of a lidar, if one is configured. `lasers`: of the configured model. Returns the problem,
/// if there is one.
template <class Calibration, class Read>
std::optional<std::string> calibrate(const LidarOptions& options, std::optional<std::size_t> lasers, const Read& read,
                                     std::optional<Calibration>& calibration) {
  if (options.calibration.empty())
    return std::nullopt;
  const auto found = read(options.calibration);
  if (!found)
    return found.error();
  if (lasers && found->laser_count != *lasers)
    return options.calibration + ": " + std::to_string(found->laser_count) + " lasers, but the lidar is a " +
           std::string{configured_model(options)};
  calibration = *found;
  return std::nullopt;
}

std::size_t columns_in(Duration period, Duration column) { return static_cast<std::size_t>(period / column) + 1; }

std::size_t most_returns_of(velodyne::Model model, Duration period) {
  const velodyne::ModelSpec& spec = velodyne::spec(model);
  return 2 * columns_in(period, spec.column_duration) * spec.firings().size();
}

/// Assumes the sequence with the most firings, and three echoes if the blocks of a packet can hold them. An OT128 in
/// high resolution, its second sequence, fires three quarters of its channels per column.
std::size_t most_returns_of(hesai::Model model, Duration period) {
  const hesai::ModelSpec& spec = hesai::spec(model);
  std::size_t firings = 0;
  for (std::size_t i = 0; i < spec.sequences.size(); ++i) {
    const bool in_part = i > 0 && spec.sequence_from == hesai::SequenceFrom::operational_state;
    firings = std::max(firings, columns_in(period, spec.sequences[i].column_duration) *
                                    (in_part ? spec.layout.channels * 3 / 4 : spec.layout.channels));
  }
  constexpr std::size_t kThree = returns_of(hesai::ReturnMode::triple);
  return firings * (spec.layout.blocks % kThree == 0 ? kThree : returns_of(hesai::ReturnMode::dual));
}

} // namespace

std::string_view configured_model(const LidarOptions& options) {
  if (options.hesai)
    return to_string(*options.hesai);
  return options.model ? velodyne::to_string(*options.model) : std::string_view{};
}

Expected<ouster::Metadata, std::string> metadata_of(const LidarOptions& options) {
  if (options.metadata_text.empty())
    return ouster::read_metadata(options.metadata);
  auto metadata = ouster::parse_metadata(options.metadata_text);
  return metadata ? std::move(metadata)
                  : Expected<ouster::Metadata, std::string>{options.metadata + ": " + metadata.error()};
}

std::size_t most_returns(const LidarOptions& options, Duration period) {
  if (options.is_ouster()) {
    constexpr std::size_t kColumnsPerSecond = 20480; // modes 2048x10 and 1024x20
    return 2 * LidarPacket::kMaxLasers * static_cast<std::size_t>(kColumnsPerSecond * to_seconds(period) + 1);
  }
  if (options.hesai)
    return most_returns_of(*options.hesai, period);
  if (options.model)
    return most_returns_of(*options.model, period);
  std::size_t most = 0;
  for (const velodyne::Model model : velodyne::kModels)
    most = std::max(most, most_returns_of(model, period));
  for (std::size_t i = 0; i < hesai::kModels; ++i)
    most = std::max(most, most_returns_of(static_cast<hesai::Model>(i), period));
  return most;
}

Expected<PacketDecoder, std::string> PacketDecoder::open(const LidarOptions& options) {
  static_cast<void>(hesai::spec(hesai::Model{})); // builds the tables now, not with the first packet
  auto decoder = decoder_for(options);
  if (!decoder)
    return decoder.error();
  return PacketDecoder{options, std::move(*decoder)};
}

PacketDecoder::PacketDecoder(const LidarOptions& options, Decoder decoder)
    : decoder_(std::move(decoder)), configured_hesai_(options.hesai), is_of_any_maker_(options.is_of_any_maker()),
      isa_(options.isa) {}

Expected<PacketDecoder::Decoder, std::string> PacketDecoder::decoder_for(const LidarOptions& options) {
  const std::string key = "lidars." + options.name + '.';
  if (options.is_ouster()) {
    const auto metadata = metadata_of(options);
    if (!metadata)
      return key + "metadata: " + metadata.error();
    return Decoder{ouster::Decoder{*metadata, options.isa}};
  }
  std::optional<std::size_t> lasers;
  if (options.is_hesai()) {
    hesai::DecoderOptions known{options.hesai, std::nullopt, options.isa};
    if (options.hesai)
      lasers = hesai::spec(*options.hesai).layout.channels;
    if (const auto problem = calibrate(options, lasers, hesai::read_calibration, known.calibration))
      return key + "calibration: " + *problem;
    return Decoder{hesai::Decoder{known}};
  }
  velodyne::DecoderOptions known{options.model, std::nullopt, std::nullopt, options.isa};
  if (options.model)
    lasers = velodyne::spec(*options.model).calibration.laser_count;
  if (const auto problem = calibrate(options, lasers, velodyne::read_calibration, known.calibration))
    return key + "calibration: " + *problem;
  return Decoder{velodyne::Decoder{known}};
}

void PacketDecoder::switch_maker(Payload payload) {
  if (!is_of_any_maker_)
    return;
  if (hesai() != nullptr && payload.size() == velodyne::kDataPacketBytes)
    decoder_.emplace<velodyne::Decoder>(velodyne::DecoderOptions{.isa = isa_});
  else if (hesai() == nullptr && hesai::look_at(payload))
    decoder_.emplace<hesai::Decoder>(hesai::DecoderOptions{.isa = isa_});
}

bool PacketDecoder::is_data(Payload payload) const {
  if (const ouster::Decoder* const sensor = ouster())
    return payload.size() == sensor->format().packet_bytes;
  if (hesai() != nullptr)
    return hesai::look_at(payload).has_value();
  return payload.size() == velodyne::kDataPacketBytes;
}

bool PacketDecoder::may_be_data(Payload payload) const {
  return is_data(payload) ||
         (is_of_any_maker_ && (payload.size() == velodyne::kDataPacketBytes || hesai::look_at(payload)));
}

bool PacketDecoder::is_position(Payload payload) const {
  return velodyne() != nullptr && payload.size() == velodyne::kPositionPacketBytes && !hesai::look_at(payload);
}

std::optional<PacketError> PacketDecoder::decode(Payload payload, Stamp host_now, LidarPacket& packet) {
  return std::visit([&](auto& decoder) { return decode_with(decoder, payload, host_now, packet); }, decoder_);
}

std::optional<PacketError> PacketDecoder::decode_with(velodyne::Decoder& decoder, Payload payload, Stamp,
                                                      LidarPacket& packet) {
  return decoder.decode(payload, packet);
}

std::optional<PacketError> PacketDecoder::decode_with(ouster::Decoder& decoder, Payload payload, Stamp host_now,
                                                      LidarPacket& packet) {
  const auto error = decoder.decode(payload, packet);
  if (!error)
    time_scale_ =
        scale_of(decoder.metadata().timestamp_mode == ouster::TimestampMode::ptp_1588, decoder.time(), host_now);
  return error;
}

std::optional<PacketError> PacketDecoder::decode_with(hesai::Decoder& decoder, Payload payload, Stamp host_now,
                                                      LidarPacket& packet) {
  const auto error = decoder.decode(payload, packet);
  if (const auto looks = decoder.recognised(); error == PacketError::model && looks)
    count_unknown(OtherMaker::hesai, looks->name, looks->model.has_value());
  if (!error)
    time_scale_ = scale_of(false, decoder.time(), host_now);
  return error;
}

PacketError PacketDecoder::reject(Payload payload) {
  if (const auto looks = hesai::look_at(payload)) {
    count_unknown(OtherMaker::hesai, looks->name, looks->model.has_value());
    return PacketError::model;
  }
  const bool is_of_ouster = ouster::format_of_lidar_packet(payload).has_value();
  const auto maker = is_of_ouster ? std::optional{OtherMaker::ouster} : unsupported_maker(payload);
  if (!maker)
    return PacketError::length;
  count_unknown(*maker);
  return PacketError::model;
}

void PacketDecoder::count_unknown(OtherMaker maker, std::string_view model, bool is_readable) {
  unknown_other_.maker = maker;
  unknown_other_.model = model;
  unknown_other_.is_readable = is_readable;
  ++unknown_other_.packets;
}

PacketLengths PacketDecoder::lengths() const {
  PacketLengths lengths;
  const auto add = [&](std::size_t bytes) { lengths.storage[lengths.count++] = bytes; };
  const auto add_hesai = [&](hesai::Model model) {
    for (const std::size_t bytes : hesai::spec(model).lengths)
      if (bytes > 0)
        add(bytes);
  };
  const auto add_all_hesai = [&] {
    for (std::size_t i = 0; i < hesai::kModels; ++i)
      add_hesai(static_cast<hesai::Model>(i));
  };
  if (ouster() != nullptr)
    add(ouster()->format().packet_bytes);
  else if (velodyne() != nullptr)
    add(velodyne::kDataPacketBytes);
  else if (hesai()->packet_bytes() > 0)
    add(hesai()->packet_bytes());
  else if (configured_hesai_)
    add_hesai(*configured_hesai_);
  if (lengths.count == 0 || (is_of_any_maker_ && velodyne() != nullptr && !velodyne()->model()))
    add_all_hesai();
  lengths.data = lengths.count;
  if (ouster() != nullptr)
    add(ouster::imu_packet_layout(ouster()->metadata()).bytes);
  if (velodyne() != nullptr)
    add(velodyne::kPositionPacketBytes);
  return lengths;
}

std::string_view PacketDecoder::model() const {
  if (const ouster::Decoder* const sensor = ouster())
    return ouster::name_of(sensor->metadata());
  if (const hesai::Decoder* const sensor = hesai())
    return sensor->model() ? to_string(*sensor->model()) : std::string_view{};
  const auto model = velodyne()->model();
  return model ? velodyne::to_string(*model) : std::string_view{};
}

std::string_view PacketDecoder::return_mode() const {
  if (const ouster::Decoder* const sensor = ouster())
    return sensor->format().profile.echoes > 1 ? "dual" : "strongest";
  if (const hesai::Decoder* const sensor = hesai())
    return sensor->return_mode() ? to_string(*sensor->return_mode()) : std::string_view{};
  const auto mode = velodyne()->return_mode();
  return mode ? velodyne::to_string(*mode) : std::string_view{};
}

std::string_view PacketDecoder::recognised_model() const {
  if (const hesai::Decoder* const sensor = hesai())
    return sensor->recognised() ? sensor->recognised()->name : std::string_view{};
  const auto model = velodyne() != nullptr ? velodyne()->recognised_model() : std::nullopt;
  return model ? velodyne::to_string(*model) : unknown_other_.model;
}

std::optional<UnknownPackets> PacketDecoder::unknown_packets() const {
  const auto unknown = velodyne() != nullptr ? velodyne()->unknown_packets() : std::nullopt;
  if (unknown && unknown->packets > unknown_other_.packets)
    return UnknownPackets{*unknown};
  return unknown_other_.packets > 0 ? std::optional{unknown_other_} : std::nullopt;
}

Duration PacketDecoder::time_of_hour() const {
  if (const ouster::Decoder* const sensor = ouster())
    return locus::time_of_hour(sensor->time(), time_scale_);
  if (const hesai::Decoder* const sensor = hesai())
    return locus::time_of_hour(sensor->time(), time_scale_);
  return velodyne()->time_of_hour();
}

double PacketDecoder::rotation_rate_rpm() const {
  if (const ouster::Decoder* const sensor = ouster())
    return sensor->rotation_rate_rpm();
  if (const hesai::Decoder* const sensor = hesai())
    return sensor->rotation_rate_rpm();
  return velodyne()->model() ? velodyne()->rotation_rate_rpm() : 0.0;
}

double PacketDecoder::turn_of_packet_cdeg() const {
  double turned_s = 0.0;
  if (const velodyne::Decoder* const decoder = velodyne()) {
    const auto columns = velodyne::packet_layout(*decoder->model(), *decoder->return_mode()).columns;
    turned_s = to_seconds(velodyne::spec(*decoder->model(), decoder->pace()).column_duration) *
               static_cast<double>(std::max<std::size_t>(columns - 1, 1));
  } else {
    turned_s = to_seconds(nominal_duration());
  }
  return rotation_rate_rpm() / 60.0 * velodyne::kCdegPerTurn * turned_s;
}

Duration PacketDecoder::nominal_duration() const {
  if (const hesai::Decoder* const sensor = hesai())
    return sensor->nominal_duration();
  const velodyne::Decoder& decoder = *velodyne();
  return velodyne::packet_duration(*decoder.model(), *decoder.return_mode(), decoder.pace());
}

std::optional<std::uint32_t> PacketDecoder::number() const {
  if (const ouster::Decoder* const sensor = ouster())
    return static_cast<std::uint32_t>(sensor->first_column());
  return hesai() != nullptr ? hesai()->number() : std::nullopt;
}

std::uint64_t PacketDecoder::packets_since(std::uint32_t number, Duration advance) const {
  constexpr std::uint32_t kMostMissing = 1'000'000; // three minutes of the fastest lidar
  if (const ouster::Decoder* const sensor = ouster())
    return sensor->packets_between(number, advance);
  const std::uint32_t missing = *hesai()->number() - number - 1;
  return missing <= kMostMissing ? missing : 0;
}

} // namespace locus
