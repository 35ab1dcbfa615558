// SPDX-License-Identifier: Apache-2.0
#include "drivers/packet_edit.hpp"

#include "drivers/hesai/packet_edit.hpp"
#include "drivers/ouster/packet_edit.hpp"
#include "drivers/velodyne/packet_edit.hpp"

namespace locus {

void shift_clock(std::span<std::byte> packet, const ouster::Metadata* ouster, Duration shift) {
  if (shift == Duration::zero())
    return;
  if (ouster != nullptr)
    ouster::shift_clock(*ouster, packet, shift);
  else if (!hesai::shift_clock(packet, shift))
    velodyne::shift_clock(packet, shift);
}

void lengthen_ranges(std::span<std::byte> packet, const ouster::Metadata* ouster, double more_m) {
  if (ouster != nullptr)
    ouster::lengthen_ranges(*ouster, packet, more_m);
  else if (!hesai::lengthen_ranges(packet, more_m))
    velodyne::lengthen_ranges(packet, more_m);
}

void narrow_view(std::span<std::byte> packet, const ouster::Metadata* ouster, double view_deg) {
  if (ouster != nullptr)
    ouster::narrow_view(*ouster, packet, view_deg);
  else if (!hesai::narrow_view(packet, view_deg))
    velodyne::narrow_view(packet, view_deg);
}

} // namespace locus
