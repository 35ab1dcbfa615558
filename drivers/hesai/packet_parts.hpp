// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <optional>
#include <span>

#include "core/base/stamp.hpp"
#include "drivers/hesai/model.hpp"

namespace locus::hesai {

/// Offsets in bytes of the packet parts that depend on flags and length.
struct PacketParts {
  std::size_t tail; ///< start of the tail
  bool has_number;  ///< a sequence number follows the tail
  std::size_t end;  ///< end of the tail and its optional fields; a CRC may follow
};

/// Locates the parts; empty if the length does not match the flags. Precondition: has_layout_of() the model.
std::optional<PacketParts> parts_of(const ModelSpec& spec, std::span<const std::byte> packet);

/// Checks the CRCs of the blocks and of the tail. Precondition, as for seal(): the layout has checksums and the parts
/// belong to the packet.
bool has_right_checksums(const ModelSpec& spec, const PacketParts& parts, std::span<const std::byte> packet);
/// Updates both CRCs.
void seal(const ModelSpec& spec, const PacketParts& parts, std::span<std::byte> packet);

/// Returns the unit of the ranges; 0 if the packet gives none. Precondition: the packet has the layout.
unsigned distance_unit_mm(const PacketLayout& layout, std::span<const std::byte> packet);

/// Returns the packet's time since 1970; empty for an invalid date.
std::optional<Duration> read_time(const std::byte* tail, const TailLayout& layout);
/// Writes a time with microsecond resolution in the packet's date format. Clamped to 1970.
void write_time(std::byte* tail, const TailLayout& layout, Duration time);

} // namespace locus::hesai
