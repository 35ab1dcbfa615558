// SPDX-License-Identifier: Apache-2.0
// Messages as they lie in a bag: the first byte says of which type and how they are written.
#include "bags/messages.hpp"
#include "fuzz/fuzz_bytes.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace locus;
  fuzz::FuzzBytes bytes(data, size);
  const auto kind = bytes.take<std::uint8_t>();
  const auto serialisation = kind % 2 == 0 ? tools::Serialisation::ros1 : tools::Serialisation::cdr;
  const tools::MessageReader reader(bytes.rest(), serialisation);
  switch (kind / 2) {
  case 0:
    tools::read_imu(reader);
    break;
  case 1:
    tools::read_odometry(reader);
    break;
  default:
    if (const auto scan = tools::read_velodyne_scan(reader))
      fuzz::demand(scan->packets.size() * velodyne::kDataPacketBytes <= size);
  }
  return 0;
}
