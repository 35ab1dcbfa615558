// SPDX-License-Identifier: Apache-2.0
// The saved state of the service, with valid checksums, because invalid ones are rejected first: simulates a file of
// another version or program.
#include <cstring>
#include <vector>

#include "daemon/service/saved_state.hpp"
#include "fuzz/memory_file.hpp"

namespace locus {
namespace {

constexpr std::size_t kHeadBytes = 4912, kHeads = 2, kBodyBytes = 88, kChecksumBytes = 8;

std::uint64_t fnv_1a(std::span<const std::uint8_t> bytes, std::uint64_t hash) {
  for (const std::uint8_t byte : bytes)
    hash = (hash ^ byte) * 0x100000001b3U;
  return hash;
}

std::vector<std::uint8_t> with_checksums(std::span<const std::uint8_t> input) {
  constexpr std::uint64_t kBasis = 0xcbf29ce484222325U;
  std::vector<std::uint8_t> file(input.begin(), input.end());
  if (file.size() < kHeads * kHeadBytes + kBodyBytes)
    return file;
  const std::span all{file};
  const auto body = all.subspan(kHeads * kHeadBytes, kBodyBytes);
  const auto put = [](std::uint64_t checksum, std::span<std::uint8_t> block) {
    std::memcpy(block.last(kChecksumBytes).data(), &checksum, kChecksumBytes);
  };
  for (std::size_t i = 0; i < kHeads; ++i) {
    const auto head = all.subspan(i * kHeadBytes, kHeadBytes);
    put(fnv_1a(head.first(kHeadBytes - kChecksumBytes), kBasis), head);
  }
  put(fnv_1a(all.subspan(kHeads * kHeadBytes + kBodyBytes), fnv_1a(body.first(kBodyBytes - kChecksumBytes), kBasis)),
      body);
  return file;
}

} // namespace
} // namespace locus

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace locus;
  using fuzz::demand;
  static const fuzz::MemoryFile kFile;
  static_cast<void>(daemon::load_state(kFile.with(fuzz::text_of(data, size))));
  const std::vector<std::uint8_t> file = with_checksums({data, size});
  const auto state = daemon::load_state(kFile.with(fuzz::text_of(file.data(), file.size())));
  if (!state)
    return 0;
  demand(state->map_odom.size() * sizeof(SurfacePoint) + kHeads * kHeadBytes + kBodyBytes == size);
  demand(state->last.extrapolated_to(stamp_from_ns(1'700'000'000'000'000'000)).finite());
  for (const SurfacePoint& point : state->map_odom)
    demand(point.position_m.allFinite() && point.normal.allFinite());
  return 0;
}
