// SPDX-License-Identifier: Apache-2.0
#include "drivers/lidar_input.hpp"

#include <algorithm>
#include <utility>

namespace locus {

Expected<LidarInput, std::string> LidarInput::open(LidarOptions options, std::uint8_t index) {
  auto decoder = PacketDecoder::open(options);
  if (!decoder)
    return decoder.error();
  return LidarInput{std::move(options), index, std::move(*decoder)};
}

LidarInput::LidarInput(LidarOptions options, std::uint8_t index, PacketDecoder decoder)
    : options_(std::move(options)), decoder_(std::move(decoder)), clock_(options_.time), sender_(options_.source_ip) {
  packet_.lidar = index;
  if (const ouster::Decoder* const sensor = decoder_.ouster())
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

std::optional<PacketError> LidarInput::process(const Datagram& datagram) {
  if (datagram.decoded != nullptr)
    return process_decoded(datagram);
  if (datagram.truncated)
    return PacketError::truncated;
  if (!sender_.may_have_sent(datagram)) {
    if (decoder_.may_be_data(datagram.payload))
      sender_.reject(datagram);
    return PacketError::sender;
  }
  if (sender_.is_silent_at(datagram.receive_stamp))
    decoder_.switch_maker(datagram.payload);
  if (decoder_.is_data(datagram.payload))
    return process_data(datagram);
  if (decoder_.ouster() != nullptr)
    return process_imu(datagram);
  if (!decoder_.is_position(datagram.payload))
    return decoder_.reject(datagram.payload);
  process_position(datagram);
  return std::nullopt;
}

void LidarInput::process_position(const Datagram& datagram) {
  position_ = velodyne::parse_position_packet(datagram.payload.first<velodyne::kPositionPacketBytes>());
  clock_.set_synchronised(position_->is_synchronised());
  if (options_.time != LidarTime::receive)
    pps_.add(*position_, datagram.receive_stamp);
  ++counters_.position;
}

/// Stamps IMU samples with the sensor's clock as estimated from the column packets; samples before the first column
/// packet are dropped. Column packets are sent up to 16 ms later than IMU packets (in recordings), so a stamp may lie
/// after its reception; `arrival` is clamped to it, otherwise the sample would be taken for one of another clock.
std::optional<PacketError> LidarInput::process_imu(const Datagram& datagram) {
  ouster::ImuMeasurements measurements;
  if (const auto error = ouster::read_imu_packet(decoder_.ouster()->metadata(), datagram.payload, measurements))
    return error;
  for (const ouster::ImuMeasurement& one : measurements.all())
    if (const auto stamp = clock_.stamp_of(time_of_hour(one.time, decoder_.time_scale()), datagram.receive_stamp))
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
  if (recent_.contains(datagram.payload))
    return PacketError::duplicate;
  if (const auto error = decoder_.decode(datagram.payload, datagram.receive_stamp + datagram.clock_set_by, packet_))
    return error;
  if (decoder_.has_date())
    clock_.set_synchronised(decoder_.time_scale() != TimeScale::free_running);
  const auto reading =
      clock_.read(decoder_.time_of_hour(), packet_.duration, datagram.receive_stamp, datagram.clock_set_by);
  counters_.clock_steps = clock_.steps();
  if (!reading)
    return PacketError::time;
  packet_.stamp = reading->stamp;
  ready_ = &packet_;
  ++counters_.data;
  loss_.add(packet_, decoder_, *reading, counters_);
  sender_.accept(datagram);
  recent_.add(datagram.payload);
  return std::nullopt;
}

std::string_view LidarInput::model() const { return counters_.data > 0 ? decoder_.model() : std::string_view{}; }

std::string_view LidarInput::return_mode() const {
  return counters_.data > 0 ? decoder_.return_mode() : std::string_view{};
}

std::string_view LidarInput::clock_state() const {
  if (decoder_.has_date())
    return counters_.data > 0 ? to_string(decoder_.time_scale()) : "absent";
  return to_string(position_ ? position_->pps : velodyne::PpsState::absent);
}

} // namespace locus
