// SPDX-License-Identifier: Apache-2.0
// MCAP files, without the leading magic.
#include "bags/mcap_record.hpp"
#include "fuzz/bag_rules.hpp"
#include "fuzz/memory_file.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace locus;
  static const fuzz::MemoryFile kFile;
  static std::string content;
  content = tools::kMcapMagic;
  content += fuzz::text_of(data, size);
  fuzz::demand_rules_of_bags(kFile.with(content));
  return 0;
}
