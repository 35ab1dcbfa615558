// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <string_view>

#include "core/base/names.hpp"

namespace locus {

/// Instruction sets that the hot kernels are built for. Results are the same bits for one of them, not between them.
enum class Isa : std::uint8_t { baseline, avx2, avx512 };

/// The words of the environment variable LOCUS_ISA.
constexpr auto names_of(Isa) { return std::to_array<std::string_view>({"baseline", "avx2", "avx512"}); }

/// The best one that this processor has.
Isa best_isa();

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
