// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <optional>
#include <span>

#include "core/base/stamp.hpp"
#include "drivers/hesai/model.hpp"

namespace locus::hesai {

/// Where in a packet stands what its flags and its length tell of, in bytes.
struct PacketParts {
  std::size_t tail; ///< begins here
  bool has_number;  ///< behind the tail
  std::size_t end;  ///< of the tail and what belongs to it; there a checksum of it may follow
};

/// Nothing where the length is not what the packet's flags call for. Precondition: has_layout_of() the model.
std::optional<PacketParts> parts_of(const ModelSpec& spec, std::span<const std::byte> packet);

/// Of the blocks, and of the tail. Precondition, of this and the next: the layout has checksums, the parts are its own.
bool has_right_checksums(const ModelSpec& spec, const PacketParts& parts, std::span<const std::byte> packet);
/// Makes them right.
void seal(const ModelSpec& spec, const PacketParts& parts, std::span<std::byte> packet);

/// Of which a range is so many; 0 where a packet says nonsense. Precondition: it has the layout.
unsigned distance_unit_mm(const PacketLayout& layout, std::span<const std::byte> packet);

/// The instant that a packet's time names, since 1970; nothing for a date that is none.
std::optional<Duration> read_time(const std::byte* tail, const TailLayout& layout);
/// Writes it in microseconds, in the form in which the packet has it. Nothing is before 1970.
void write_time(std::byte* tail, const TailLayout& layout, Duration time);

} // namespace locus::hesai
