// SPDX-License-Identifier: Apache-2.0
// ROS 1 bags. (ROS 2 bags are databases read by SQLite, or MCAP, which has its own target.)
#include "fuzz/bag_rules.hpp"
#include "fuzz/memory_file.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace locus;
  static const fuzz::MemoryFile kFile;
  const auto path = kFile.with(fuzz::text_of(data, size));
  if (tools::looks_like_bag(path))
    fuzz::demand_rules_of_bags(path);
  return 0;
}
