// SPDX-License-Identifier: Apache-2.0
// Reads the table of the times of a folder of sweeps from arbitrary bytes.
#include "sweep_folder/sweep_times.hpp"

#include <algorithm>
#include <functional>

#include "fuzz/fuzz_bytes.hpp"
#include "fuzz/memory_file.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace locus;
  static const fuzz::MemoryFile kFile;
  const std::filesystem::path file = kFile.with(fuzz::text_of(data, size));
  const auto times = tools::read_times(file);
  if (!times) {
    fuzz::demand(times.error().starts_with(file.string() + ": "));
    return 0;
  }
  const auto stamps = tools::stamps_of(*times);
  if (!stamps) {
    fuzz::demand(stamps.error().starts_with(file.string() + ":") && stamps.error().find('\n') == std::string::npos);
    return 0;
  }
  fuzz::demand(stamps->size() == times->size());
  fuzz::demand(std::ranges::adjacent_find(*stamps, std::greater_equal{}) == stamps->end());
  fuzz::demand(tools::usual_step(*stamps) >= std::chrono::milliseconds{5});
  return 0;
}
