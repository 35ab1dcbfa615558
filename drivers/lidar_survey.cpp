// SPDX-License-Identifier: Apache-2.0
#include "drivers/lidar_survey.hpp"

#include <algorithm>
#include <cmath>
#include <tuple>
#include <utility>

namespace locus {

std::string SurveyedLidar::name() const {
  std::string what = "an unknown lidar";
  if (!model.empty())
    what = model;
  else if (ouster)
    what = *ouster > 0 ? "Ouster " + std::to_string(*ouster) : "Ouster";
  return what + " at " + dotted(ip);
}

std::string SurveyedLidar::clock_state() const {
  if (clock)
    return "clock " + std::string{to_string(*clock)};
  return "PPS " + std::string{pps ? to_string(*pps) : "unknown"};
}

void LidarSurvey::add(const Datagram& datagram) {
  if (datagram.payload.size() == velodyne::kPositionPacketBytes &&
      (pps_.size() < kMaxSenders || pps_.contains(datagram.source_ip)))
    pps_[datagram.source_ip] =
        velodyne::parse_position_packet(datagram.payload.first<velodyne::kPositionPacketBytes>()).pps;
  const auto key = std::pair{datagram.source_ip, datagram.destination_port};
  const bool is_one = datagram.payload.size() == velodyne::kDataPacketBytes || hesai::look_at(datagram.payload) ||
                      ouster::format_of_lidar_packet(datagram.payload) || unsupported_maker(datagram.payload);
  if (!is_one || (senders_.size() >= kMaxSenders && !senders_.contains(key)))
    return;
  auto& sender = senders_[key];
  if (!sender)
    sender = std::make_unique<Sender>();
  if (!sender->read(datagram))
    return;
  sender->first = sender->packets++ == 0 ? datagram.receive_stamp : sender->first;
  sender->last = datagram.receive_stamp;
}

bool LidarSurvey::Sender::read(const Datagram& datagram) {
  if (const auto format = ouster::format_of_lidar_packet(datagram.payload)) {
    read_ouster(*format, datagram);
    return true;
  }
  if (const auto looks = hesai::look_at(datagram.payload)) {
    if (const auto error = hesai.decode(datagram.payload, packet)) {
      if (error == PacketError::model)
        refuse(OtherMaker::hesai, *looks);
      return false;
    }
    clock = scale_of(false, hesai.time(), datagram.receive_stamp);
    return true;
  }
  if (const auto maker = unsupported_maker(datagram.payload)) {
    refuse(*maker, {});
    return false;
  }
  return !velodyne.decode(datagram.payload, packet);
}

void LidarSurvey::Sender::refuse(OtherMaker maker, const hesai::Looks& looks) {
  unknown_other = {{.packets = unknown_other.packets + 1}, maker, looks.name, looks.model.has_value()};
}

void LidarSurvey::Sender::read_ouster(const ouster::PacketFormat& format, const Datagram& datagram) {
  ouster = format.header(datagram.payload).serial_number;
  beams = ouster::pixels_of_length(datagram.payload.size());
  mode.add(format, datagram.payload);
  const std::byte* const column = format.column(datagram.payload.data(), format.columns_per_packet / 2);
  const std::uint64_t time_ns = ouster::PacketFormat::time_of(column);
  if (format.is_valid(column) && time_ns <= static_cast<std::uint64_t>(to_ns(kLatestStamp)))
    clock = scale_of(false, Duration{static_cast<Duration::rep>(time_ns)}, datagram.receive_stamp);
}

void LidarSurvey::OusterMode::add(const ouster::PacketFormat& format, std::span<const std::byte> packet) {
  const std::byte* const one = format.column(packet.data(), 0);
  const std::byte* const next = format.column(packet.data(), 1);
  if (!format.is_valid(one) || !format.is_valid(next))
    return;
  const auto time_of = [](const std::byte* at) {
    return Duration{static_cast<Duration::rep>(ouster::PacketFormat::time_of(at))};
  };
  column = time_of(next) - time_of(one);
  const auto id = static_cast<std::uint16_t>(format.header(packet).frame_id);
  const auto before = std::exchange(frame_id, id);
  if (!before || *before == id)
    return;
  last = Turn{id, time_of(one)};
  first = first.value_or(*last);
}

double LidarSurvey::OusterMode::turns_per_s() const {
  if (!first || last->begin <= first->begin)
    return 0.0;
  return static_cast<std::uint16_t>(last->frame_id - first->frame_id) / to_seconds(last->begin - first->begin);
}

std::size_t LidarSurvey::OusterMode::columns_per_turn() const {
  const double turn_s = turns_per_s() * to_seconds(column);
  return turn_s > 0.0 ? static_cast<std::size_t>(std::lround(1.0 / turn_s)) : 0;
}

std::vector<SurveyedLidar> LidarSurvey::lidars() const {
  std::vector<SurveyedLidar> found;
  for (const auto& [key, sender] : senders_) {
    SurveyedLidar& lidar = found.emplace_back();
    std::tie(lidar.ip, lidar.port) = key;
    if (const auto unknown = sender->velodyne.unknown_packets())
      lidar.unknown_packets = UnknownPackets{*unknown};
    if (sender->unknown_other.packets > 0)
      lidar.unknown_packets = sender->unknown_other;
    if (const auto pps = pps_.find(lidar.ip); pps != pps_.end())
      lidar.pps = pps->second;
    if (sender->packets == 0)
      continue;
    if (sender->ouster) {
      lidar.ouster = sender->ouster;
      lidar.beams = sender->beams;
      lidar.columns_per_turn = sender->mode.columns_per_turn();
      lidar.rotation_rate_rpm = 60.0 * sender->mode.turns_per_s();
      lidar.clock = sender->clock;
    }
    if (const auto model = sender->velodyne.model()) {
      lidar.model = velodyne::to_string(*model);
      lidar.return_mode = velodyne::to_string(*sender->velodyne.return_mode());
      lidar.rotation_rate_rpm = sender->velodyne.rotation_rate_rpm();
    }
    if (const auto model = sender->hesai.model()) {
      lidar.model = to_string(*model);
      lidar.return_mode = to_string(*sender->hesai.return_mode());
      lidar.rotation_rate_rpm = sender->hesai.rotation_rate_rpm();
      lidar.clock = sender->clock;
    }
    lidar.packets_per_s =
        static_cast<double>(sender->packets - 1) / std::max(1e-3, to_seconds(sender->last - sender->first));
  }
  return found;
}

} // namespace locus
