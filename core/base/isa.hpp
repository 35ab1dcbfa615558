// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string_view>

namespace locus {

/// Instruction sets that the hot kernels are built for. Results are the same bits for one of them, not between them.
enum class Isa : std::uint8_t { baseline, avx2, avx512 };

inline constexpr std::array<std::string_view, 3> kIsaNames{"baseline", "avx2", "avx512"};
constexpr std::string_view to_string(Isa isa) { return kIsaNames[static_cast<std::size_t>(isa)]; }

/// The best one that this processor has.
Isa best_isa();

/// By name, for those who want to choose (environment variable LOCUS_ISA); nothing for a name that is none of
/// kIsaNames.
std::optional<Isa> isa_from_string(std::string_view name);

/// Whether this processor can run it.
bool is_supported(Isa isa);

#if defined(__x86_64__)
template <class Body> [[gnu::flatten, gnu::target("avx2,fma")]] void run_as_avx2(const Body& body) { body(); }
template <class Body>
[[gnu::flatten, gnu::target("avx512f,avx512vl,avx512dq,fma")]] void run_as_avx512(const Body& body) {
  body();
}
#endif

/// Runs `body` in the instructions of a set that the processor has: one source, compiled for each. That holds for what
/// is inlined, so no type changes its layout; a body is a loop or two over plain arrays.
template <class Body> void run_as(Isa isa, const Body& body) {
#if defined(__x86_64__)
  if (isa == Isa::avx512)
    return run_as_avx512(body);
  if (isa == Isa::avx2)
    return run_as_avx2(body);
#endif
  static_cast<void>(isa);
  body();
}

} // namespace locus
