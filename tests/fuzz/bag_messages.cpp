// SPDX-License-Identifier: Apache-2.0
// Messages of bags: the first byte selects type and serialisation.
#include "bags/messages.hpp"
#include "discovery/static_transforms.hpp"
#include "fuzz/fuzz_bytes.hpp"

namespace {

/// Reads the same transforms twice: a chain of them is finite and has an inverse, however absurd the tree.
void demand_rules_of_transforms(locus::MessageReader reader) {
  locus::tools::StaticTransforms transforms;
  transforms.add(reader);
  transforms.add(reader);
  const auto there = transforms.between("a", "b"), back = transforms.between("b", "a");
  locus::fuzz::demand(there.has_value() == back.has_value());
}

} // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace locus;
  fuzz::FuzzBytes bytes(data, size);
  const auto kind = bytes.take<std::uint8_t>();
  const auto serialisation = kind % 2 == 0 ? Serialisation::ros1 : Serialisation::cdr;
  const MessageReader reader(bytes.rest(), serialisation);
  fuzz::demand(tools::frame_of(reader).size() <= size);
  switch (kind / 2) {
  case 0:
    tools::read_imu(reader);
    break;
  case 1:
    tools::read_odometry(reader);
    break;
  case 127: // above the kinds of packets
    demand_rules_of_transforms(reader);
    break;
  default:
    const tools::PacketType& type = tools::packet_types()[(kind / 2U - 2U) % tools::packet_types().size()];
    if (const auto packets = type.read(reader)) // each has a stamp, or a length of 4 bytes
      fuzz::demand(packets->packets.size() * 4 + packets->bytes.size() <= size);
  }
  return 0;
}
