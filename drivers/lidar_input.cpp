// SPDX-License-Identifier: Apache-2.0
#include "drivers/lidar_input.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "drivers/velodyne/calibration.hpp"

namespace locus {

namespace {

constexpr Duration kSenderTimeout = std::chrono::seconds{1};
constexpr Duration kLongestGapToldByAzimuth = std::chrono::seconds{1};
constexpr double kAzimuthToleranceCdeg = 100.0;
constexpr double kSpeedTolerance = 0.02; ///< by which the motor's speed may change over a gap

} // namespace

Expected<LidarInput, std::string> LidarInput::open(LidarOptions options, std::uint8_t index) {
  if (options.calibration.empty())
    return LidarInput{std::move(options), index, std::nullopt};
  auto calibration = velodyne::read_calibration(options.calibration);
  const std::string key = "lidars." + options.name + ".calibration: ";
  if (!calibration)
    return key + calibration.error();
  if (options.model && calibration->laser_count != velodyne::spec(*options.model).calibration.laser_count)
    return key + options.calibration + ": " + std::to_string(calibration->laser_count) +
           " lasers, but the lidar is a " + std::string{to_string(*options.model)};
  return LidarInput{std::move(options), index, *calibration};
}

LidarInput::LidarInput(LidarOptions options, std::uint8_t index, std::optional<velodyne::Calibration> calibration)
    : options_(std::move(options)), decoder_({options_.model, std::nullopt, calibration, options_.isa}),
      clock_(options_.time) {
  packet_.lidar = index;
}

const LidarPacket* LidarInput::receive(const Datagram& datagram) {
  packet_is_ready_ = false;
  ++counters_.received;
  if (const auto error = take(datagram))
    ++counters_[*error];
  return packet_is_ready_ ? &packet_ : nullptr;
}

bool LidarInput::listens_to(std::uint16_t port) const {
  constexpr int kPositionPortDistance = kDefaultPositionPort - kDefaultDataPort;
  return port == options_.port || port == kDefaultPositionPort || port == options_.port + kPositionPortDistance;
}

std::optional<std::uint32_t> LidarInput::source_ip() const {
  return options_.source_ip ? options_.source_ip : learnt_ip_;
}

std::optional<PacketError> LidarInput::take(const Datagram& datagram) {
  if (datagram.decoded != nullptr)
    return take_decoded(datagram);
  if (datagram.truncated)
    return PacketError::truncated;
  if (!is_sender(datagram)) {
    refuse_sender(datagram);
    return PacketError::sender;
  }
  if (datagram.payload.size() == velodyne::kDataPacketBytes)
    return take_data(datagram);
  if (datagram.payload.size() != velodyne::kPositionPacketBytes)
    return PacketError::length;
  position_ = velodyne::parse_position_packet(datagram.payload.first<velodyne::kPositionPacketBytes>());
  clock_.set_synchronised(position_->is_synchronised());
  ++counters_.position;
  return std::nullopt;
}

/// Its stamp is that of the recording: there is no sensor's clock to reckon it from.
std::optional<PacketError> LidarInput::take_decoded(const Datagram& datagram) {
  const std::uint8_t index = packet_.lidar;
  packet_ = *datagram.decoded;
  packet_.lidar = index;
  packet_is_ready_ = true;
  ++counters_.data;
  return std::nullopt;
}

std::optional<PacketError> LidarInput::take_data(const Datagram& datagram) {
  if (is_duplicate(datagram.payload))
    return PacketError::duplicate;
  if (const auto error = decoder_.decode(datagram.payload, packet_))
    return error;
  const auto reading =
      clock_.read(decoder_.time_of_hour(), packet_.duration, datagram.receive_stamp, datagram.clock_set_by);
  counters_.clock_steps = clock_.steps();
  if (!reading)
    return PacketError::time;
  packet_.stamp = reading->stamp;
  packet_is_ready_ = true;
  count(*reading);
  remember(datagram);
  return std::nullopt;
}

bool LidarInput::is_sender(const Datagram& datagram) const {
  if (options_.source_ip || !learnt_ip_)
    return !options_.source_ip || *options_.source_ip == datagram.source_ip;
  return *learnt_ip_ == datagram.source_ip || datagram.receive_stamp - last_heard_ > kSenderTimeout;
}

void LidarInput::refuse_sender(const Datagram& datagram) {
  if (datagram.payload.size() != velodyne::kDataPacketBytes)
    return;
  refused_ip_ = datagram.source_ip;
  const auto known = std::ranges::find_if(
      strangers_, [&](const Stranger& stranger) { return stranger.packets == 0 || stranger.ip == datagram.source_ip; });
  if (known != strangers_.end())
    *known = {datagram.source_ip, known->packets + 1};
}

bool LidarInput::is_duplicate(std::span<const std::byte> payload) const {
  const auto end = recent_.begin() + static_cast<std::ptrdiff_t>(std::min(remembered_, kRemembered));
  return std::any_of(recent_.begin(), end,
                     [&](const Payload& seen) { return std::memcmp(seen.data(), payload.data(), seen.size()) == 0; });
}

/// Share by which the speed may differ over a gap: the motor's own, or what the azimuths of a packet, in hundredths of
/// a degree, tell it to. The VLS-128 turns by 0.4 degrees between the first and the last column of a packet, or less.
double LidarInput::speed_tolerance() const {
  constexpr double kRoundingCdeg = 1.5;
  const velodyne::Model model = *decoder_.model();
  const auto columns = velodyne::packet_layout(model, *decoder_.return_mode()).columns;
  const double turned_s = to_seconds(velodyne::spec(model, decoder_.pace()).column_duration) *
                          static_cast<double>(std::max<std::size_t>(columns - 1, 1));
  const double turned_cdeg = decoder_.rotation_rate_rpm() / 60.0 * velodyne::kCdegPerTurn * turned_s;
  return std::max(kSpeedTolerance, kRoundingCdeg / std::max(turned_cdeg, kRoundingCdeg));
}

/// Packets that should lie between the latest one and this one, and do not.
std::uint64_t LidarInput::missing_before(const SensorClock::Reading& reading) const {
  const Duration nominal = velodyne::packet_duration(*decoder_.model(), *decoder_.return_mode(), decoder_.pace());
  const auto missing = std::llround(to_seconds(reading.advance - last_duration_) / to_seconds(nominal));
  if (missing <= 0)
    return 0;
  if (reading.advance <= kLongestGapToldByAzimuth) {
    const double expected_cdeg =
        decoder_.rotation_rate_rpm() / 60.0 * velodyne::kCdegPerTurn * to_seconds(reading.advance);
    const double turned_cdeg = packet_.first_azimuth_cdeg - last_azimuth_cdeg_;
    const double error_cdeg = std::remainder(turned_cdeg - expected_cdeg, velodyne::kCdegPerTurn);
    if (std::abs(error_cdeg) > kAzimuthToleranceCdeg + speed_tolerance() * expected_cdeg)
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
    counters_.lost += missing_before(reading);
  last_azimuth_cdeg_ = packet_.first_azimuth_cdeg;
  last_duration_ = packet_.duration;
}

void LidarInput::remember(const Datagram& datagram) {
  learnt_ip_ = datagram.source_ip;
  last_heard_ = datagram.receive_stamp;
  std::copy(datagram.payload.begin(), datagram.payload.end(), recent_[remembered_ % kRemembered].begin());
  ++remembered_;
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
  if (LidarInput* lidar = find(datagram))
    return lidar->receive(datagram);
  ++foreign_.received;
  ++foreign_[PacketError::sender];
  return nullptr;
}

/// The lidar of this address, else one on this port that has no address yet, else one on this port (which will refuse).
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

std::string_view LidarRouter::configured_for(const Datagram& datagram) const {
  const auto found = std::ranges::find_if(lidars_, [&](const LidarInput& lidar) {
    return lidar.listens_to(datagram.destination_port) &&
           lidar.options().source_ip.value_or(datagram.source_ip) == datagram.source_ip;
  });
  return found == lidars_.end() ? std::string_view{} : found->options().name;
}

LidarRouter::Senders LidarRouter::senders_to(std::uint16_t port) const {
  Senders senders;
  for (const LidarInput& lidar : lidars_) {
    if (!lidar.listens_to(port))
      continue;
    if (!lidar.source_ip() || senders.count == Senders::kMax)
      return {};
    senders.ips[senders.count++] = *lidar.source_ip();
  }
  return senders;
}

PacketCounters LidarRouter::total() const {
  PacketCounters sum = foreign_;
  for (const LidarInput& lidar : lidars_)
    sum += lidar.counters();
  return sum;
}

} // namespace locus
