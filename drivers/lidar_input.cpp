// SPDX-License-Identifier: Apache-2.0
#include "drivers/lidar_input.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <utility>

#include "drivers/hesai/calibration.hpp"
#include "drivers/velodyne/calibration.hpp"

namespace locus {

namespace {

constexpr Duration kSenderTimeout = std::chrono::seconds{1};
/// Time after which an unused PPS is worth reporting, and after which it counts as used again: a receiver sends a good
/// sentence among bad ones.
constexpr Duration kLasts = std::chrono::seconds{5};
constexpr Duration kLongestGapByAzimuth = std::chrono::seconds{1};
constexpr double kAzimuthToleranceCdeg = 100.0;
constexpr double kSpeedTolerance = 0.02; ///< relative change of the motor's speed over a gap

Expected<hesai::Decoder, std::string> hesai_decoder(const LidarOptions& options) {
  hesai::DecoderOptions known{options.hesai, std::nullopt, options.isa};
  if (options.calibration.empty())
    return hesai::Decoder{known};
  const auto read = hesai::read_calibration(options.calibration);
  if (!read)
    return read.error();
  if (options.hesai && read->laser_count != hesai::spec(*options.hesai).layout.channels)
    return options.calibration + ": " + std::to_string(read->laser_count) + " lasers, but the lidar is a " +
           std::string{to_string(*options.hesai)};
  known.calibration = *read;
  return hesai::Decoder{known};
}

/// Returns the number of packets missing between two sequence numbers; 0 if the lidar has restarted its count.
std::uint64_t sent_between(std::uint32_t before, std::uint32_t now) {
  constexpr std::uint32_t kMostMissing = 1'000'000; // three minutes of the fastest lidar
  const std::uint32_t missing = now - before - 1;
  return missing <= kMostMissing ? missing : 0;
}

} // namespace

std::string_view configured_model(const LidarOptions& options) {
  if (options.hesai)
    return to_string(*options.hesai);
  return options.model ? velodyne::to_string(*options.model) : std::string_view{};
}

Expected<LidarInput, std::string> LidarInput::open(LidarOptions options, std::uint8_t index) {
  static_cast<void>(hesai::spec(hesai::Model{})); // builds the tables now, not with the first packet
  auto decoder = decoder_for(options);
  if (!decoder)
    return decoder.error();
  return LidarInput{std::move(options), index, std::move(*decoder)};
}

Expected<LidarInput::Decoder, std::string> LidarInput::decoder_for(const LidarOptions& options) {
  const std::string key = "lidars." + options.name + '.';
  if (options.is_ouster()) {
    const auto metadata = metadata_of(options);
    if (!metadata)
      return key + "metadata: " + metadata.error();
    return Decoder{ouster::Decoder{*metadata, options.isa}};
  }
  if (options.is_hesai()) {
    const auto decoder = hesai_decoder(options);
    return decoder ? Expected<Decoder, std::string>{Decoder{*decoder}} : key + "calibration: " + decoder.error();
  }
  std::optional<velodyne::Calibration> calibration;
  if (!options.calibration.empty()) {
    const auto read = velodyne::read_calibration(options.calibration);
    if (!read)
      return key + "calibration: " + read.error();
    if (options.model && read->laser_count != velodyne::spec(*options.model).calibration.laser_count)
      return key + "calibration: " + options.calibration + ": " + std::to_string(read->laser_count) +
             " lasers, but the lidar is a " + std::string{to_string(*options.model)};
    calibration = *read;
  }
  return Decoder{velodyne::Decoder{{options.model, std::nullopt, calibration, options.isa}}};
}

LidarInput::LidarInput(LidarOptions options, std::uint8_t index, Decoder decoder)
    : options_(std::move(options)), decoder_(std::move(decoder)), clock_(options_.time) {
  packet_.lidar = index;
  if (const ouster::Decoder* const sensor = ouster())
    options_.imu_port = sensor->metadata().imu_port;
}

const LidarPacket* LidarInput::receive(const Datagram& datagram) {
  ready_ = nullptr;
  imu_count_ = 0;
  ++counters_.received;
  if (const auto error = process(datagram)) {
    ++counters_[*error];
    if (*error == PacketError::model)
      unknown_last_received_ = datagram.receive_stamp;
  }
  return ready_;
}

Expected<ouster::Metadata, std::string> metadata_of(const LidarOptions& options) {
  if (options.metadata_text.empty())
    return ouster::read_metadata(options.metadata);
  auto metadata = ouster::parse_metadata(options.metadata_text);
  return metadata ? std::move(metadata)
                  : Expected<ouster::Metadata, std::string>{options.metadata + ": " + metadata.error()};
}

bool LidarInput::listens_to(std::uint16_t port) const {
  constexpr int kPositionPortDistance = kDefaultPositionPort - kDefaultDataPort;
  if (options_.gives_clouds())
    return false;
  if (options_.is_ouster())
    return port == options_.port || port == options_.imu_port;
  if (options_.is_hesai())
    return port == options_.port;
  return port == options_.port || port == kDefaultPositionPort || port == options_.port + kPositionPortDistance;
}

PacketLengths LidarInput::packet_lengths() const {
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
  if (const ouster::Decoder* const sensor = ouster()) {
    add(sensor->format().packet_bytes);
    lengths.data = lengths.count;
    add(ouster::imu_packet_layout(sensor->metadata()).bytes);
    return lengths;
  }
  if (const hesai::Decoder* const sensor = hesai()) {
    if (sensor->packet_bytes() > 0)
      add(sensor->packet_bytes());
    else if (options_.hesai)
      add_hesai(*options_.hesai);
    else
      add_all_hesai();
    lengths.data = lengths.count;
    return lengths;
  }
  add(velodyne::kDataPacketBytes);
  if (options_.is_of_any_maker() && counters_.data == 0)
    add_all_hesai();
  lengths.data = lengths.count;
  add(velodyne::kPositionPacketBytes);
  return lengths;
}

std::optional<std::uint32_t> LidarInput::source_ip() const {
  return options_.source_ip ? options_.source_ip : learnt_ip_;
}

/// Switches to the decoder of the maker that this packet belongs to, unless a packet was decoded within the timeout.
void LidarInput::follow_maker(const Datagram& datagram) {
  if (!options_.is_of_any_maker() || (counters_.data > 0 && datagram.receive_stamp - last_received_ <= kSenderTimeout))
    return;
  if (hesai() != nullptr && datagram.payload.size() == velodyne::kDataPacketBytes)
    decoder_.emplace<velodyne::Decoder>(velodyne::DecoderOptions{.isa = options_.isa});
  else if (const auto looks = hesai::look_at(datagram.payload); looks && hesai() == nullptr)
    decoder_.emplace<hesai::Decoder>(hesai::DecoderOptions{.isa = options_.isa});
}

std::optional<PacketError> LidarInput::process(const Datagram& datagram) {
  if (datagram.decoded != nullptr)
    return process_decoded(datagram);
  if (datagram.truncated)
    return PacketError::truncated;
  if (!is_sender(datagram)) {
    refuse_sender(datagram);
    return PacketError::sender;
  }
  follow_maker(datagram);
  if (is_data_packet(datagram))
    return process_data(datagram);
  if (ouster() != nullptr)
    return process_imu(datagram);
  if (const auto looks = hesai::look_at(datagram.payload)) {
    refuse(OtherMaker::hesai, looks->name, looks->model.has_value());
    return PacketError::model;
  }
  if (hesai() == nullptr && datagram.payload.size() == velodyne::kPositionPacketBytes) {
    process_position(datagram);
    return std::nullopt;
  }
  const bool is_of_ouster = ouster::format_of_lidar_packet(datagram.payload).has_value();
  const auto maker = is_of_ouster ? std::optional{OtherMaker::ouster} : unsupported_maker(datagram.payload);
  if (!maker)
    return PacketError::length;
  refuse(*maker);
  return PacketError::model;
}

void LidarInput::process_position(const Datagram& datagram) {
  position_ = velodyne::parse_position_packet(datagram.payload.first<velodyne::kPositionPacketBytes>());
  clock_.set_synchronised(position_->is_synchronised());
  const std::string_view why = options_.time != LidarTime::receive ? velodyne::why_unused(*position_) : "";
  if (why.empty())
    pps_used_since_ = pps_used_since_.value_or(datagram.receive_stamp);
  else if (pps_used_since_.reset(); why != std::exchange(pps_unused_for_, why))
    pps_unused_since_ = datagram.receive_stamp;
  if (pps_used_since_ && datagram.receive_stamp - *pps_used_since_ > kLasts)
    pps_unused_for_ = {};
  ++counters_.position;
}

/// Stamps IMU samples with the sensor's clock as estimated from the column packets; samples before the first column
/// packet are dropped. Column packets are sent up to 16 ms later than IMU packets (in recordings), so a stamp may lie
/// after its reception; `arrival` is clamped to it, otherwise the sample would be taken for one of another clock.
std::optional<PacketError> LidarInput::process_imu(const Datagram& datagram) {
  ouster::ImuMeasurements measurements;
  if (const auto error = ouster::read_imu_packet(ouster()->metadata(), datagram.payload, measurements))
    return error;
  for (const ouster::ImuMeasurement& one : measurements.all())
    if (const auto stamp = clock_.stamp_of(locus::time_of_hour(one.time, time_scale_), datagram.receive_stamp))
      imu_samples_[imu_count_++] = {.stamp = *stamp,
                                    .arrival = std::max(datagram.receive_stamp, *stamp),
                                    .angular_velocity_radps = one.angular_velocity_radps,
                                    .specific_force_mps2 = one.specific_force_mps2,
                                    .attitude = std::nullopt};
  ++counters_.position;
  return std::nullopt;
}

/// Keeps the stamp of the recording: a decoded packet carries no sensor time.
std::optional<PacketError> LidarInput::process_decoded(const Datagram& datagram) {
  ready_ = datagram.decoded;
  if (const std::uint8_t index = packet_.lidar; ready_->lidar != index) {
    packet_ = *ready_;
    packet_.lidar = index;
    ready_ = &packet_;
  }
  ++counters_.data;
  return std::nullopt;
}

std::optional<PacketError> LidarInput::process_data(const Datagram& datagram) {
  if (is_duplicate(datagram.payload))
    return PacketError::duplicate;
  if (const auto error = decode(datagram))
    return error;
  const auto reading = clock_.read(time_of_hour(), packet_.duration, datagram.receive_stamp, datagram.clock_set_by);
  counters_.clock_steps = clock_.steps();
  if (!reading)
    return PacketError::time;
  packet_.stamp = reading->stamp;
  ready_ = &packet_;
  count(*reading);
  store(datagram);
  return std::nullopt;
}

std::optional<PacketError> LidarInput::decode(const Datagram& datagram) {
  if (auto* const velodyne = std::get_if<velodyne::Decoder>(&decoder_))
    return velodyne->decode(datagram.payload, packet_);
  const Stamp host_now = datagram.receive_stamp + datagram.clock_set_by;
  if (auto* const hesai = std::get_if<hesai::Decoder>(&decoder_)) {
    if (const auto error = decode_hesai(*hesai, datagram))
      return error;
    time_scale_ = scale_of(false, hesai->time(), host_now);
  } else {
    auto& sensor = std::get<ouster::Decoder>(decoder_);
    if (const auto error = sensor.decode(datagram.payload, packet_))
      return error;
    const bool is_set_to_ptp = sensor.metadata().timestamp_mode == ouster::TimestampMode::ptp_1588;
    time_scale_ = scale_of(is_set_to_ptp, sensor.time(), host_now);
  }
  clock_.set_synchronised(time_scale_ != TimeScale::free_running);
  return std::nullopt;
}

std::optional<PacketError> LidarInput::decode_hesai(hesai::Decoder& decoder, const Datagram& datagram) {
  const auto error = decoder.decode(datagram.payload, packet_);
  if (const auto looks = decoder.recognised(); error == PacketError::model && looks)
    refuse(OtherMaker::hesai, looks->name, looks->model.has_value());
  return error;
}

void LidarInput::refuse(OtherMaker maker, std::string_view model, bool is_readable) {
  unknown_other_.maker = maker;
  unknown_other_.model = model;
  unknown_other_.is_readable = is_readable;
  ++unknown_other_.packets;
}

/// Time of hour of the last good packet.
Duration LidarInput::time_of_hour() const {
  if (const ouster::Decoder* const sensor = ouster())
    return locus::time_of_hour(sensor->time(), time_scale_);
  if (const hesai::Decoder* const sensor = hesai())
    return locus::time_of_hour(sensor->time(), time_scale_);
  return velodyne()->time_of_hour();
}

/// Recognises data packets by length or content.
bool LidarInput::is_data_packet(const Datagram& datagram) const {
  if (const ouster::Decoder* const sensor = ouster())
    return datagram.payload.size() == sensor->format().packet_bytes;
  if (hesai() != nullptr)
    return hesai::look_at(datagram.payload).has_value();
  return datagram.payload.size() == velodyne::kDataPacketBytes;
}

std::string_view LidarInput::model() const {
  if (const ouster::Decoder* const sensor = ouster())
    return counters_.data > 0 ? ouster::name_of(sensor->metadata()) : std::string_view{};
  if (const hesai::Decoder* const sensor = hesai())
    return sensor->model() ? to_string(*sensor->model()) : std::string_view{};
  const auto model = velodyne()->model();
  return model ? velodyne::to_string(*model) : std::string_view{};
}

std::string_view LidarInput::return_mode() const {
  if (const ouster::Decoder* const sensor = ouster())
    return counters_.data == 0 ? "" : sensor->format().profile.echoes > 1 ? "dual" : "strongest";
  if (const hesai::Decoder* const sensor = hesai())
    return sensor->return_mode() ? to_string(*sensor->return_mode()) : std::string_view{};
  const auto mode = velodyne()->return_mode();
  return mode ? velodyne::to_string(*mode) : std::string_view{};
}

std::string_view LidarInput::recognised_model() const {
  if (const hesai::Decoder* const sensor = hesai())
    return sensor->recognised() ? sensor->recognised()->name : std::string_view{};
  const auto model = velodyne() != nullptr ? velodyne()->recognised_model() : std::nullopt;
  return model ? velodyne::to_string(*model) : unknown_other_.model;
}

std::string_view LidarInput::clock_state() const {
  if (has_date())
    return counters_.data > 0 ? to_string(time_scale_) : "absent";
  return to_string(position_ ? position_->pps : velodyne::PpsState::absent);
}

std::string_view LidarInput::why_pps_is_unused() const {
  return last_received_ - pps_unused_since_ > kLasts ? pps_unused_for_ : std::string_view{};
}

double LidarInput::rotation_rate_rpm() const {
  if (const ouster::Decoder* const sensor = ouster())
    return sensor->rotation_rate_rpm();
  if (const hesai::Decoder* const sensor = hesai())
    return sensor->rotation_rate_rpm();
  return velodyne()->model() ? velodyne()->rotation_rate_rpm() : 0.0;
}

std::optional<UnknownPackets> LidarInput::unknown_packets() const {
  const auto unknown = velodyne() != nullptr ? velodyne()->unknown_packets() : std::nullopt;
  if (unknown && unknown->packets > unknown_other_.packets)
    return UnknownPackets{*unknown};
  return unknown_other_.packets > 0 ? std::optional{unknown_other_} : std::nullopt;
}

bool LidarInput::is_sender(const Datagram& datagram) const {
  if (options_.source_ip || !learnt_ip_)
    return !options_.source_ip || *options_.source_ip == datagram.source_ip;
  return *learnt_ip_ == datagram.source_ip || datagram.receive_stamp - last_received_ > kSenderTimeout;
}

void LidarInput::refuse_sender(const Datagram& datagram) {
  const bool is_of_another_maker =
      options_.is_of_any_maker() &&
      (datagram.payload.size() == velodyne::kDataPacketBytes || hesai::look_at(datagram.payload));
  if (!is_data_packet(datagram) && !is_of_another_maker)
    return;
  refused_ip_ = datagram.source_ip;
  const auto known = std::ranges::find_if(other_senders_, [&](const OtherSender& sender) {
    return sender.packets == 0 || sender.ip == datagram.source_ip;
  });
  if (known != other_senders_.end())
    *known = {datagram.source_ip, known->packets + 1, datagram.receive_stamp};
}

bool LidarInput::is_duplicate(std::span<const std::byte> payload) const {
  const auto end = recent_.begin() + static_cast<std::ptrdiff_t>(std::min(stored_, kStored));
  const std::size_t bytes = std::min(payload.size(), velodyne::kDataPacketBytes);
  return std::any_of(recent_.begin(), end,
                     [&](const Payload& recent) { return std::memcmp(recent.data(), payload.data(), bytes) == 0; });
}

/// Rotation from the first to the last column of the last good packet, hundredths of a degree.
double LidarInput::turn_of_packet_cdeg() const {
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

/// Time from one packet to the next, Velodyne or Hesai.
Duration LidarInput::nominal_duration() const {
  if (const hesai::Decoder* const sensor = hesai())
    return sensor->nominal_duration();
  const velodyne::Decoder& decoder = *velodyne();
  return velodyne::packet_duration(*decoder.model(), *decoder.return_mode(), decoder.pace());
}

/// Returns the number of packets missing between the latest one and this one. The tolerance covers the motor's speed
/// change over a gap and the azimuth resolution of 0.01 degrees: the VLS-128 turns by 0.4 degrees or less between the
/// first and the last column of a packet.
std::uint64_t LidarInput::missing_before(const SensorClock::Reading& reading) const {
  constexpr double kRoundingCdeg = 1.5;
  if (const ouster::Decoder* const sensor = ouster())
    return sensor->packets_between(last_first_column_, reading.advance);
  if (const hesai::Decoder* const sensor = hesai(); sensor != nullptr && sensor->number())
    return sent_between(last_number_, *sensor->number());
  const double rounding = kRoundingCdeg / std::max(turn_of_packet_cdeg(), kRoundingCdeg);
  const Duration skipped = std::max(last_duration_ - nominal_duration(), Duration{}); // known as well as the speed
  const auto missing = std::llround((to_seconds(reading.advance - last_duration_) - rounding * to_seconds(skipped)) /
                                    to_seconds(nominal_duration()));
  if (missing <= 0)
    return 0;
  if (reading.advance <= kLongestGapByAzimuth) {
    const double expected_cdeg = rotation_rate_rpm() / 60.0 * velodyne::kCdegPerTurn * to_seconds(reading.advance);
    const double turned_cdeg = packet_.first_azimuth_cdeg - last_azimuth_cdeg_;
    const double error_cdeg = std::remainder(turned_cdeg - expected_cdeg, velodyne::kCdegPerTurn);
    if (std::abs(error_cdeg) > kAzimuthToleranceCdeg + std::max(kSpeedTolerance, rounding) * expected_cdeg)
      return 0;
  }
  return static_cast<std::uint64_t>(missing);
}

void LidarInput::count(const SensorClock::Reading& reading) {
  ++counters_.data;
  if (reading.continuous && reading.advance <= Duration{}) {
    ++counters_.reordered;
    counters_.lost -= std::min<std::uint64_t>(counters_.lost, 1);
    return;
  }
  if (reading.continuous)
    count_lost(reading);
  last_azimuth_cdeg_ = packet_.first_azimuth_cdeg;
  last_first_column_ = ouster() != nullptr ? ouster()->first_column() : 0;
  last_number_ = hesai() != nullptr ? hesai()->number().value_or(0) : 0;
  last_duration_ = packet_.duration;
}

void LidarInput::count_lost(const SensorClock::Reading& reading) {
  const bool has_numbers = ouster() != nullptr || (hesai() != nullptr && hesai()->number());
  const std::uint64_t missing = missing_before(reading);
  if (has_numbers) {
    counters_.lost += missing;
    return;
  }
  const double cdeg_per_s = rotation_rate_rpm() / 60.0 * velodyne::kCdegPerTurn;
  const double turned_cdeg = cdeg_per_s * to_seconds(reading.advance);
  const bool within_a_turn = missing > 0 && turned_cdeg < velodyne::kCdegPerTurn;
  counters_.lost += within_a_turn ? sectors_.lost_between(last_azimuth_cdeg_ + cdeg_per_s * to_seconds(last_duration_),
                                                          packet_.first_azimuth_cdeg, missing)
                                  : missing;
  const bool skips_a_sector = 2 * packet_.duration > 3 * nominal_duration();
  sectors_.add(packet_.first_azimuth_cdeg, skips_a_sector ? 0.0 : turn_of_packet_cdeg(), turned_cdeg);
  counters_.lost -= std::min(counters_.lost, sectors_.withdraw_false_losses()); // maybe also this gap
}

void LidarInput::store(const Datagram& datagram) {
  learnt_ip_ = datagram.source_ip;
  last_received_ = datagram.receive_stamp;
  std::memcpy(recent_[stored_ % kStored].data(), datagram.payload.data(),
              std::min(datagram.payload.size(), velodyne::kDataPacketBytes));
  ++stored_;
}

Expected<LidarRouter, std::string> LidarRouter::open(const std::vector<LidarOptions>& options) {
  std::vector<LidarInput> lidars;
  lidars.reserve(options.size());
  for (const LidarOptions& one : options) {
    auto lidar = LidarInput::open(one, static_cast<std::uint8_t>(lidars.size()));
    if (!lidar)
      return lidar.error();
    lidars.push_back(std::move(*lidar));
  }
  return LidarRouter{std::move(lidars)};
}

const LidarPacket* LidarRouter::receive(const Datagram& datagram) {
  if (LidarInput* lidar = find(datagram)) {
    latest_ = static_cast<std::size_t>(lidar - lidars_.data());
    return lidar->receive(datagram);
  }
  latest_.reset();
  ++foreign_.received;
  ++foreign_[PacketError::sender];
  return nullptr;
}

/// Finds the lidar with this address, else one on this port without an address, else one on this port (which rejects
/// the datagram).
LidarInput* LidarRouter::find(const Datagram& datagram) {
  LidarInput* found = nullptr;
  for (LidarInput& lidar : lidars_) {
    if (!lidar.listens_to(datagram.destination_port))
      continue;
    if (lidar.source_ip() == datagram.source_ip)
      return &lidar;
    if (found == nullptr || (found->source_ip() && !lidar.source_ip()))
      found = &lidar;
  }
  return found;
}

LidarRouter::Origin LidarRouter::configured_for(const Datagram& datagram) const {
  const auto found = std::ranges::find_if(lidars_, [&](const LidarInput& lidar) {
    return lidar.listens_to(datagram.destination_port) &&
           lidar.options().source_ip.value_or(datagram.source_ip) == datagram.source_ip;
  });
  if (found == lidars_.end())
    return {};
  return {found->options().name, found->ouster() != nullptr ? &found->ouster()->metadata() : nullptr};
}

void LidarRouter::Senders::add_lengths(std::span<const std::size_t> more) {
  for (const std::size_t bytes : more)
    if (std::ranges::find(all_lengths(), bytes) == all_lengths().end() && length_count < kMaxLengths)
      lengths[length_count++] = bytes;
}

LidarRouter::Senders LidarRouter::senders_to(std::uint16_t port) const {
  Senders senders;
  std::size_t lidars = 0;
  for (const LidarInput& lidar : lidars_) {
    if (lidars == Senders::kMax || !lidar.listens_to(port))
      continue;
    if (lidars++ == 0)
      senders.length_count = 0;
    const PacketLengths lengths = lidar.packet_lengths();
    senders.add_lengths(lengths.all());
    if (lidar.source_ip())
      senders.ips[senders.count++] = *lidar.source_ip();
  }
  if (senders.count < lidars)
    senders.count = 0;
  return senders;
}

PacketCounters LidarRouter::total() const {
  PacketCounters sum = foreign_;
  for (const LidarInput& lidar : lidars_)
    sum += lidar.counters();
  return sum;
}

} // namespace locus
