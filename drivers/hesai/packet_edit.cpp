// SPDX-License-Identifier: Apache-2.0
#include "drivers/hesai/packet_edit.hpp"

#include <limits>

#include "drivers/field_of_view.hpp"
#include "drivers/hesai/packet_parts.hpp"
#include "drivers/longer_range.hpp"
#include "drivers/wire.hpp"

namespace locus::hesai {

namespace {

/// Calls `change` with the layout and the tail of a packet, then updates its checksums if they were correct. Returns
/// false if the model is not supported.
template <class Change> bool edit(std::span<std::byte> packet, Change&& change) {
  const auto looks = look_at(packet);
  if (!looks || !looks->model)
    return false;
  const ModelSpec& its = spec(*looks->model);
  const auto parts = parts_of(its, packet);
  if (!parts)
    return false;
  const bool is_sealed = its.layout.has_checksums && has_right_checksums(its, *parts, packet);
  change(its.layout, packet.data() + parts->tail);
  if (is_sealed)
    seal(its, *parts, packet);
  return true;
}

} // namespace

bool shift_clock(std::span<std::byte> packet, Duration shift) {
  return edit(packet, [&](const PacketLayout& layout, std::byte* tail) {
    if (const auto time = read_time(tail, layout.tail))
      write_time(tail, layout.tail, *time + shift);
  });
}

bool lengthen_ranges(std::span<std::byte> packet, double more_m) {
  return edit(packet, [&](const PacketLayout& layout, const std::byte*) {
    const unsigned unit_mm = distance_unit_mm(layout, packet);
    const double more = unit_mm == 0 ? 0.0 : 1e3 * more_m / unit_mm;
    for (std::size_t block = 0; block < layout.blocks; ++block) {
      std::byte* range = packet.data() + layout.header + block * layout.block() + layout.block_header;
      for (std::size_t channel = 0; channel < layout.channels; ++channel, range += layout.channel) {
        constexpr std::uint32_t kLongest = std::numeric_limits<std::uint16_t>::max();
        put_little_endian(range, longer_range(read_u16(range), more, kLongest), 2);
      }
    }
  });
}

bool narrow_view(std::span<std::byte> packet, double view_deg) {
  return edit(packet, [&](const PacketLayout& layout, const std::byte*) {
    for (std::size_t block = 0; block < layout.blocks; ++block) {
      std::byte* const first = packet.data() + layout.header + block * layout.block() + layout.block_header;
      if (is_in_view(0.01 * read_u16(first - 2), view_deg))
        continue;
      for (std::size_t channel = 0; channel < layout.channels; ++channel)
        put_little_endian(first + channel * layout.channel, 0, 2);
    }
  });
}

} // namespace locus::hesai
