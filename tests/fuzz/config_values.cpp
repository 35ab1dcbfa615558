// SPDX-License-Identifier: Apache-2.0
// Options of --set, one per line and at most three, because each costs as much; the result is printed and must parse to
// an equal configuration.
#include <sstream>
#include <string>
#include <vector>

#include "config/config_yaml.hpp"
#include "fuzz/fuzz_bytes.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace locus;
  static const Config kDefaults;
  static constexpr std::size_t kMostAssignments = 3;
  std::istringstream text{std::string{fuzz::text_of(data, size)}};
  std::vector<std::string> assignments;
  for (std::string line; assignments.size() < kMostAssignments && std::getline(text, line);)
    assignments.push_back(line);
  const auto config = override_config(kDefaults, assignments);
  if (!config)
    return 0;
  const std::string printed = print_config(*config);
  const auto again = parse_config(printed, "printed.yaml");
  fuzz::demand(again.has_value() && print_config(*again) == printed);
  return 0;
}
