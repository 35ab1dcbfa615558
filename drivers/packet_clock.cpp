// SPDX-License-Identifier: Apache-2.0
#include "drivers/packet_clock.hpp"

#include <chrono>

#include "drivers/hesai/packet_parts.hpp"
#include "drivers/velodyne/model.hpp"
#include "drivers/wire.hpp"

namespace locus {

namespace {

using Packet = std::span<const std::byte>;

constexpr Duration kClockPeriod = std::chrono::hours{1};

std::optional<Duration> ouster_time(const ouster::PacketFormat& format, Packet packet) {
  if (packet.size() != format.packet_bytes)
    return std::nullopt;
  for (std::size_t i = 0; i < format.columns_per_packet; ++i) {
    const std::byte* const column = format.column(packet.data(), i);
    const std::uint64_t time_ns = ouster::PacketFormat::time_of(column);
    if (format.is_valid(column) && time_ns <= static_cast<std::uint64_t>(to_ns(kLatestStamp)))
      return Duration{static_cast<std::int64_t>(time_ns)};
  }
  return std::nullopt;
}

std::optional<Duration> hesai_time(hesai::Model model, Packet packet) {
  const hesai::ModelSpec& spec = hesai::spec(model);
  const auto parts = hesai::parts_of(spec, packet);
  return parts ? hesai::read_time(packet.data() + parts->tail, spec.layout.tail) : std::nullopt;
}

std::optional<Duration> velodyne_time(Packet packet) {
  const bool is_data =
      packet.size() == velodyne::kDataPacketBytes && read_u16(packet.data()) == velodyne::kBankFlags.front();
  return is_data ? std::optional<Duration>(std::chrono::microseconds{read_u32(packet.data() + velodyne::kTimeOffset)})
                 : std::nullopt;
}

} // namespace

std::optional<Duration> clock_in(Packet packet, const ouster::Metadata* ouster) {
  std::optional<Duration> time;
  if (ouster != nullptr)
    time = ouster_time(ouster->packet_format(), packet);
  else if (const auto looks = hesai::look_at(packet))
    time = looks->model ? hesai_time(*looks->model, packet) : std::nullopt;
  else
    time = velodyne_time(packet);
  return time ? std::optional(*time % kClockPeriod) : std::nullopt;
}

Duration clock_advance(Duration earlier, Duration later) {
  const Duration half = kClockPeriod / 2;
  return (later - earlier + half + kClockPeriod) % kClockPeriod - half;
}

} // namespace locus
