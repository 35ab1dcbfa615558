// SPDX-License-Identifier: Apache-2.0
#include "drivers/ouster/packet_edit.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>

#include "drivers/field_of_view.hpp"
#include "drivers/longer_range.hpp"
#include "drivers/ouster/checksum.hpp"
#include "drivers/ouster/imu_packet.hpp"
#include "drivers/wire.hpp"

namespace locus::ouster {

namespace {

using Packet = std::span<std::byte>;

/// Edits a packet, and updates its checksum if it was correct.
template <class Change> void edit(Packet packet, Change&& change) {
  const bool is_sealed = packet.size() > PacketFormat::kPacketFooterBytes && has_right_checksum(packet);
  change();
  if (is_sealed)
    seal(packet);
}

/// Calls `change` with each valid column of a lidar packet.
template <class Change> void edit_columns(const PacketFormat& format, Packet packet, Change&& change) {
  if (packet.size() != format.packet_bytes)
    return;
  edit(packet, [&] {
    for (std::size_t i = 0; i < format.columns_per_packet; ++i) {
      const std::byte* const column = format.column(packet.data(), i);
      if (format.is_valid(column))
        change(packet.data() + (column - packet.data()));
    }
  });
}

/// Calls `change` with each measurement of an IMU packet.
template <class Change> void edit_measurements(const ImuPacketLayout& layout, Packet packet, Change&& change) {
  if (packet.size() != layout.bytes)
    return;
  edit(packet, [&] {
    for (std::size_t i = 0; i < layout.count; ++i)
      change(packet.data() + layout.first + i * layout.stride);
  });
}

void shift_time(std::byte* at, Duration shift) {
  const std::uint64_t time_ns = read_u64(at);
  if (time_ns > static_cast<std::uint64_t>(to_ns(kLatestStamp)))
    return; // invalid
  const auto shifted_ns = static_cast<std::int64_t>(time_ns) + shift.count();
  put_little_endian(at, static_cast<std::uint64_t>(std::max<std::int64_t>(shifted_ns, 0)), 8);
}

void put_float(std::byte* at, float value) { put_little_endian(at, std::bit_cast<std::uint32_t>(value), 4); }

void put_range(std::byte* at, std::uint32_t range_mask, std::uint32_t counts) {
  put_little_endian(at, (read_u32(at) & ~range_mask) | counts, 4);
}

/// Calls `change` with each range of a column.
template <class Change> void edit_ranges(const PacketFormat& format, std::byte* column, Change&& change) {
  std::byte* pixel = column + (format.pixels_of(column) - column);
  for (std::size_t i = 0; i < format.pixels_per_column; ++i, pixel += format.profile.pixel_bytes) {
    for (std::size_t echo = 0; echo < format.profile.echoes; ++echo)
      change(pixel + format.profile.echo_fields[echo].range_at);
  }
}

} // namespace

void shift_clock(const Metadata& metadata, Packet packet, Duration shift) {
  edit_columns(metadata.packet_format(), packet, [&](std::byte* column) { shift_time(column, shift); });
  const ImuPacketLayout layout = imu_packet_layout(metadata);
  edit_measurements(layout, packet, [&](std::byte* measurement) { shift_time(measurement + layout.time, shift); });
}

void lengthen_ranges(const Metadata& metadata, Packet packet, double more_m) {
  const PacketFormat format = metadata.packet_format();
  const std::uint32_t longest = (1U << format.profile.range_bits) - 1;
  const double more = 1e3 * more_m / static_cast<double>(1U << format.profile.range_shift);
  edit_columns(format, packet, [&](std::byte* column) {
    edit_ranges(format, column, [&](std::byte* range) {
      put_range(range, longest, longer_range(read_u32(range) & longest, more, longest));
    });
  });
}

void narrow_view(const Metadata& metadata, Packet packet, double view_deg) {
  const PacketFormat format = metadata.packet_format();
  const std::uint32_t longest = (1U << format.profile.range_bits) - 1;
  const Eigen::Matrix3d R = metadata.T_sensor_lidar.R();
  const double zero_deg = std::atan2(R(1, 0), R(0, 0)) / kRadPerDeg;
  const double step_deg = 360.0 / static_cast<double>(metadata.columns_per_frame);
  edit_columns(format, packet, [&](std::byte* column) {
    if (!is_in_view(zero_deg - step_deg * PacketFormat::measurement_id_of(column), view_deg))
      edit_ranges(format, column, [&](std::byte* range) { put_range(range, longest, 0); });
  });
}

void add_turn(const Metadata& metadata, Packet packet, double more_radps) {
  const ImuPacketLayout layout = imu_packet_layout(metadata);
  const auto more = static_cast<float>(more_radps / layout.rate_unit_radps);
  edit_measurements(layout, packet, [&](std::byte* measurement) {
    std::byte* const rate_z = measurement + layout.rate + 8;
    put_float(rate_z, std::bit_cast<float>(read_u32(rate_z)) + more);
  });
}

void make_nan(const Metadata& metadata, Packet packet) {
  const ImuPacketLayout layout = imu_packet_layout(metadata);
  edit_measurements(layout, packet, [&](std::byte* measurement) {
    for (std::size_t i = 0; i < 12; i += 4) {
      put_float(measurement + layout.force + i, std::numeric_limits<float>::quiet_NaN());
      put_float(measurement + layout.rate + i, std::numeric_limits<float>::quiet_NaN());
    }
  });
}

} // namespace locus::ouster
