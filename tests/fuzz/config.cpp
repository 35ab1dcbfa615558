// SPDX-License-Identifier: Apache-2.0
// Configuration files: accepted, or rejected with one line per error.
#include <string>

#include "config/config_yaml.hpp"
#include "fuzz/fuzz_bytes.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace locus;
  using fuzz::demand;
  const auto config = parse_config(std::string{fuzz::text_of(data, size)}, "fuzz.yaml");
  if (config) {
    demand(!config->problem());
    return 0;
  }
  demand(!config.error().empty());
  for (const std::string& line : config.error())
    demand(line.starts_with("fuzz.yaml:") && line.find('\n') == std::string::npos);
  return 0;
}
